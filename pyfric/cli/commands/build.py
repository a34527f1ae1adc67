"""Information on this build, and checks of it."""

from __future__ import annotations

import click

from pyfric.cli.app import main
from pyfric.cli.shared import Exit, Tell, record_of, stop, telling


@main.command(section="This build")
@click.argument("record", required=False, metavar="[RECORD]", type=click.Path())
@telling
def info(record: str | None, tell: Tell) -> None:
    """Show version, compiler, instruction sets and threads, or the content of a RECORD.

    For a RECORD it prints what `pyfric run` prints: events, method, notes, and expected and
    measured errors.
    """
    if record is not None:
        from pyfric.record import summary, text

        held = summary(record_of(record), [])
        tell.result(held, lambda: text(held))
        return

    import platform

    import numpy as np

    from pyfric import core
    from pyfric.scene import __version__

    found = {
        "pyfric": __version__,
        "variant": core.VARIANT,
        "variants": core.variants(),
        "environment": core.ENVIRONMENT,
        **core.build_info(),
        "lacks": core.lacks(),
        "processors": core.processors(),
        "blocks_per_thread": core.BLOCKS_PER_THREAD,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": platform.machine(),
    }
    kinds = [
        name if runs else f"{name} (not on this processor)"
        for name, runs in found["variants"].items()
    ]
    rows = found | {
        "variants": ", ".join(kinds),
        "environment": f"{core.ENVIRONMENT} names another variant",
        "openmp": "yes" if found["openmp"] else "no",
        "lacks": "; ".join(found["lacks"]) or "nothing",
        "blocks_per_thread": f"{core.BLOCKS_PER_THREAD} at least",
    }
    tell.result(found, lambda: "\n".join(f"{name:<18} {value}" for name, value in rows.items()))


@main.command(
    section="This build",
    epilog="""\b
Exit codes:
    0  all checks hold
    1  a check fails
""",
)
@telling
def verify(tell: Tell) -> None:
    """Check this build (a minute): bits, exact answers, and stored runs of full dynamics."""
    from pyfric.checks import verify as checks

    table = checks.verify(progress=lambda group: tell.step(f"{group} ..."))
    tell.table(table, checks.report)
    if not table["holds"].all():
        stop(Exit.FAILED)


@main.command(section="This build")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the script that completes commands, options, scenes and fields in SHELL.

    \b
    bash:  pyfric completion bash >> ~/.bashrc
    zsh:   pyfric completion zsh >> ~/.zshrc
    fish:  pyfric completion fish > ~/.config/fish/completions/pyfric.fish
    """
    from click.shell_completion import get_completion_class

    kind = get_completion_class(shell)
    template, names = kind.source_template, kind(main, {}, "pyfric", "_PYFRIC_COMPLETE")
    click.echo(template % names.source_vars())

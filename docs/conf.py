"""The documentation site: `make docs` builds it into docs/_build/html; warnings are errors."""

import ast
import doctest
import os
import pickle
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click
import latex2mathml.converter
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from docutils import nodes
from PIL import Image
from sphinx_gallery.scrapers import figure_rst, matplotlib_scraper

import pyfric
from pyfric.cli.commands import main
from pyfric.figures import style as house

# They are attributes of pyfric, and autodoc looks for modules.
sys.modules |= {"pyfric.analysis": pyfric.analysis, "pyfric.theory": pyfric.theory}

project = "pyfric"
author = "the pyfric maintainers"
version = release = pyfric.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.doctest",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "sphinx_gallery.gen_gallery",
]

exclude_patterns = ["_build"]
suppress_warnings = ["config.cache", "toc.empty_glob"]
nitpicky = False

# Pages are Markdown, with the paper's letters as they are; tables of reference_data are included.
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist", "substitution"]
myst_heading_anchors = 3
smartquotes = False  # it would turn --json into a dash

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "description"
autodoc_typehints_format = "short"
autosummary_generate = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False


def table(head, rows):
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in line)} |" for line in lines)


def stored(path):
    """Return a table of reference_data."""
    return pd.read_csv(ROOT / "reference_data" / path)


def held():
    """Return what a record holds."""
    return table(
        ["group", "name", "dimensions", "unit", "meaning"],
        [
            [group, f"`{one.name}`", ", ".join(one.dims), one.unit, one.meaning]
            for group in pyfric.record.GROUPS
            for one in pyfric.record.held_in(group).values()
        ],
    )


def modules():
    """Return the first line of each module, room by room."""
    rows = []
    for path in sorted((ROOT / "pyfric").rglob("*.py")):
        name = path.relative_to(ROOT / "pyfric").with_suffix("").as_posix()
        if path.stem[0] != "_":
            text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
            rows.append([f"`{name}`", text.splitlines()[0].replace("|", "\\|")])
    for path in sorted((ROOT / "fortran").glob("*.f90")):
        text = path.read_text(encoding="utf-8").splitlines()[0].lstrip("!> ")
        rows.append([f"`fortran/{path.stem}`", text.replace("|", "\\|")])
    return table(["module", "what it is"], rows)


def run_columns():
    """Return the numbers of runs, with units."""
    rows = [[f"`{name}`", of.unit, of.meaning] for name, of in pyfric.RUN_COLUMNS.items()]
    return table(["number", "unit", "meaning"], rows)


def plans(data):
    """Return how many plans kept their tolerance, by question."""
    data = data.assign(silent=data["beyond_tolerance"] & ~data["said"])
    counted = ["beyond_tolerance", "silent", "beyond_measured", "not_measured", "no_front_speed"]
    rows = [
        [want.replace("_", " "), len(part), *part[counted].astype(bool).sum()]
        for want, part in [*data.groupby("want"), ("all", data)]
    ]
    head = ["question", "random scenes", "error beyond the tolerance"]
    head += [
        "of which the record says nothing",
        "beyond the measured error",
        "not measured, or in part",
        "of which no front has a speed",
    ]
    return table(head, rows)


def sticks(data):
    """Return what other programs make of one block, at a step of 1 ms or the finest tolerance."""
    rows = []
    for (name, settings), part in data.groupby(["program", "settings"], sort=False):
        at = part[part["step"] == 1e-3]
        row = (at if len(at) else part).iloc[-1]
        creep = ", ".join(f"{row[key]:.2g}" for key in ("creep_half", "creep_near"))
        forces = f"{row['F_max']:.3f}, {row['F_min']:.3f}"
        known = "one" if row["coefficients"] == "one" else "both"
        cells = [f"{name} {row['version']}", settings, known, creep]
        cells += [f"{row['error']:.2g}", forces]
        rows.append([*cells, f"{row['seconds']:.2g}"])
    head = ["program", "settings", "mu", "creep at 0.5, at 0.999 (m)"]
    head += ["error of the force over p", "largest force, least (N)", "seconds"]
    return table(head, rows)


def sticks_chain(data):
    """Return what other programs make of a chain, at a step of 1 ms or the finest tolerance."""
    rows = []
    for (name, settings), part in data.groupby(["program", "settings"], sort=False):
        at = part[part["step"] == 1e-3]
        row = (at if len(at) else part).iloc[-1]
        cells = [f"{name} {row['version']}", settings, row["coefficients"]]
        rows.append([*cells, f"{row['error']:.2g}", f"{row['seconds']:.2g}"])
    head = ["program", "settings", "coefficients", "largest error of the force over p", "seconds"]
    return table(head, rows)


def curves(data):
    """Return the population of events of each curve of paper on paper, and its coefficients."""
    rows = []
    for _, row in data.iterrows():
        forces = [f"{row[of]:.3f} +- {row[f'{of}_error']:.3f}" for of in ("peak", "valley")]
        waits = f"{row['recurrence']:.3g} +- {row['recurrence_std']:.2g}"
        ends = [
            f"{row[mu]:.3f} ({row[f'{mu}_low']:.3f} to {row[f'{mu}_high']:.3f})"
            for mu in ("mu_s", "mu_k")
        ]
        cells = [f"{row['k']:.0f}", f"{row['V']:.0f}", f"{row['large']:.0f}", f"{row['stuck']:.2g}"]
        cells += [f"{row['force']:.3f}", *forces, f"{row['peak_std']:.3f}", waits]
        rows.append([*cells, f"{row['follow']:.2f}", *ends, f"{row['chi2']:.3g}"])
    head = ["k (N/m)", "V (um/s)", "large events", "rise over k V/F_N", "mean force", "mean peak"]
    head += ["mean valley", "std of peaks", "recurrence, its std (s)", "peaks follow", "mu_s"]
    return table([*head, "mu_k", "chi^2"], rows)


def laws_of_curves(data):
    """Return what would be one number for all curves of paper on paper if one law held."""
    rows = []
    for _, row in data.iterrows():
        numbers = [f"{row[of]:.3f}" for of in ("mean", "std", "error")]
        chi2 = f"{row['chi2']:.3g} ({row['dof']})"
        rows.append([row["number"], row["curves"], *numbers, chi2])
    head = ["number", "curves", "weighted mean", "std from curve to curve", "error of a curve"]
    return table([*head, "chi^2 (degrees of freedom)"], rows)


def promises(data):
    """Return what records say where a promise is hard to keep, beside what was found."""
    data = data[["scene", "quantity", "said", "found"]].astype(str)
    return table(["scene", "quantity", "stated", "found"], data.to_numpy().tolist())


def plan_costs(data):
    """Return what planned runs take beside a run in finite geometry without verification."""
    ratio = data["seconds_run"] / data["seconds_alone"]
    low, middle, high = ratio.quantile([0.05, 0.5, 0.95])
    long = ratio[data["seconds_alone"] > 1.0]
    two = (data["levels"] == 2).mean()
    return (
        f"A run with its verification takes {middle:.2g} times the processor time of a run in "
        f"finite geometry alone (median; 90 % lie between {low:.2g} and {high:.2g}; at most "
        f"{long.max():.2g} where that takes more than a second). In {two:.0%} two levels were "
        f"made; in {data['not_made'].mean():.0%} a further one would have exceeded the budget."
    )


def plan_accuracy(data):
    """Return how far real errors are below measured ones."""
    known = data[(data["real"] > 0) & (data["measured"] > 0)]
    times = (known["measured"] / known["real"]).quantile([0.1, 0.5])
    return (
        f"The measured error is that of the coarser run. The real error of the finer one, which is "
        f"returned, is {times[0.5]:.2g} times smaller (median; in nine of ten trials at least "
        f"{times[0.1]:.2g} times)."
    )


SCENES = {
    "d_c": "$d_c$ = 1 um",
    "setup 2": "setup 2",
    "theta = 0.833": r"$\theta$ = 0.833, finite, to 0.3 s",
    "whole curve": "$l$ = 2.5 mm, to 0.9 s",
    "sequence": "quasi-static, to 0.9 s",
    "plan": "`plan`",
}
"""Words of the cases of `studies finer`."""


def case_in_words(name):
    """Return the scene of a case of `studies finer`."""
    parts = [
        SCENES.get(part, f"$l$ = {part}" if "mm" in part else part) for part in name.split(", ")
    ]
    return ", ".join(parts)


def finer(data):
    """Return what runs on finer and finer lattices cost, and their errors."""
    rows = []
    for _, one in data[data["build"] == "this"].iterrows():
        steps, counts = "", ("steps", "attempts", "refused")
        attempts, errors = "", [f"{one[name]:.0e}" for name in ("error", "error_jumps")]
        if np.isfinite(one["steps"]):
            steps, tried, refused = (f"{one[name]:.0f}" for name in counts)
            attempts = f"{tried} ({refused})"
        errors = ["" if "nan" in error else error for error in errors]
        rows.append([case_in_words(one["case"]), f"{one['seconds']:.2g}", steps, attempts, *errors])
        rows[-1].append(f"{one['GB']:.2g}")
    head = ["scene", "time (s)", "steps", "attempts to jump (refused)", "error of steps and jumps"]
    return table([*head, "error of jumps", "memory (GB)"], rows)


def builds(data):
    """Return the times and errors of other builds beside those of this one."""
    others = [build for build in data["build"].unique() if build != "this"]
    rows = []
    for case, part in data.groupby("case", sort=False):
        part = part.set_index("build")
        cells = [f"{part['seconds'][build] / part['seconds']['this']:.2f}" for build in others]
        errors = [f"{part['error'][build]:.0e}" for build in ("this", *others)]
        errors = ["" if "nan" in error else error for error in errors]
        rows.append([case_in_words(case), *cells, *errors])
    head = ["scene", *(f"time of {build} over that of this build" for build in others)]
    return table([*head, *(f"error, {build}" for build in ("this build", *others))], rows)


def method_costs(data):
    """Return errors and costs of methods in the Fig. 1 scene, beside the paper's method."""
    named = data[data["kind"].isin(["method", "peer"]) & data["name"].notna()]
    rows = [
        [one["name"].replace("\n", " "), f"{one['precursors']:.1e}", f"{one['cheaper']:.3g}"]
        for _, one in named.sort_values("cheaper").iterrows()
    ]
    return table(["method", "error of start and arrest forces ($F_N$)", "times cheaper"], rows)


def share(one, name):
    """Return a share of the variance of ln v_c with its interval, and what position alone gives."""
    text = "{:.2f} ({:.2f} to {:.2f}".format(
        *(one[f"{name}_{end}"] for end in ("value", "low", "high"))
    )
    return f"{text})" if name == "position" else f"{text}; {one[f'{name}_null']:.2f})"


def prestress(coulomb, resolved):
    """Return the share of the variance of ln v_c that the scaled prestress explains."""
    coulomb = coulomb[(coulomb["d_c"] == 0) & (coulomb["precursors"] == "last")]
    known = ("prestress", "position")
    rows = [
        [
            "0",
            f"the paper's, l = {1e3 * one['l']:g} mm",
            "-",
            *(share(one, name) for name in known),
            "-",
        ]
        for _, one in coulomb.iterrows()
    ]
    own = resolved[resolved["places"] == "own"].sort_values(["viscosity", "d_c"])
    rows += [
        [
            f"{1e6 * one['d_c']:g}",
            one["viscosity"],
            f"{one['above_R']:.0%}",
            *(share(one, name) for name in (*known, "release")),
        ]
        for _, one in own.iterrows()
    ]
    head = ["$d_c$ (um)", r"$\eta^2$", "$v_c > c_R$", "prestress", "position", r"$G/\Gamma$"]
    return table(head, rows)


def resolved_checks(data):
    """Return what the speeds of a resolved front hang on."""
    rows = [
        [
            one["case"],
            f"{one['median']:.1%}",
            f"{one['median_change']:+.1%}",
            f"{one['reached']:+.3f}",
        ]
        for _, one in data.iterrows()
    ]
    return table(
        ["change", "median of abs(change of v_c)", "median change", "change of L_p/L"], rows
    )


def precursors(found, points):
    """Return how many precursors each series has, and where they end."""
    rows = []
    number = points.set_index(["series", "share"])
    for name, part in found.groupby("series", sort=False):
        ends = part.set_index("by")
        known = points[points["series"] == name]
        rated, last = known["law"].iloc[0] == "rate_and_state", known["share"].max()
        cells = [name, known["runs"].iloc[0]]
        for share in (0.2, 0.4, 0.8) if rated else (0.05, 0.1, 0.2):
            is_run = (name, share) in number.index
            cells.append(counted(number.loc[(name, share)]) if is_run else "")
        cells += [
            ended(ends.loc[by], last) for by in ("half of the first count", "contact", "rate")
        ]
        half = ends.loc["half of the first count"]
        L_c = half["end"] * 1e3 * known["L"].iloc[0]
        rows.append([*cells, f"{L_c:.0f}", f"{half['zone']:.1f}"])
    head = ["series", "seeds", "0.05 (0.2)", "0.1 (0.4)", "0.2 (0.8)"]
    head += ["half", "end", "end by rate", "$L_c$ at half (mm)", "blocks in the zone there"]
    return table(head, rows)


def counted(one):
    """Return a mean count with its standard error."""
    return f"{one['mean']:.1f} ± {one['error']:.1f}"


def ended(one, last):
    """Return an end with its interval."""
    if one["end"] == 0:
        return "none"
    if not np.isfinite(one["end"]):
        return f"> {last:g}"
    if not np.isfinite(one["high"]):
        return f"{one['end']:.2f} ({one['low']:.2f} to > {last:g})"
    return f"{one['end']:.2f} ({one['low']:.2f} to {one['high']:.2f})"


def precursor_scales(data):
    """Return the share of the variance of counts that each scale predicts."""
    rows = []
    data = data[data["by"] == "contact"]
    for scale, part in data.groupby("scale", sort=False):
        cells = [f"${scale}$"]
        for law in ("slip weakening", "rate and state"):
            one = part[part["law"] == law]
            told = "{share:.2f} ({low:.2f} to {high:.2f})"
            cells.append(told.format(**one.iloc[0]) if len(one) else "")
        rows.append(cells)
    return table(["scale", "slip weakening", "rate and state"], rows)


def regimes():
    """Return what happens at the edges of the model."""
    data = stored("regimes/regimes.csv")
    data = data[["regime", "stated", "text"]].astype(str)
    return table(["edge", "behaviour", "what is seen"], data.to_numpy().tolist())


def half_step(name, head):
    """Return points of the phase diagram of the chain, or of its lines, with half the step too."""
    data = stored(f"phases/{name}")
    return table(
        head,
        [
            [f"{one:.6g}" if isinstance(one, float) else one for one in row]
            for row in data.to_numpy()
        ],
    )


def write_commands():
    """Write one page for each section of the command line, from the commands themselves."""
    folder = ROOT / "docs" / "commands"
    folder.mkdir(exist_ok=True)
    for section in main.sections:
        listed = [
            name for name in main.list_commands(None) if main.commands[name].section == section
        ]
        lines = [f"# {section}: {', '.join(listed)}", ""]
        for name in listed:
            command = main.commands[name]
            module = sys.modules[command.callback.__module__]
            found = [key for key, one in vars(module).items() if one is command]
            where = f"{module.__name__}:{found[0]}"
            nested = "full" if isinstance(command, click.Group) else "none"
            lines += ["```{eval-rst}", f".. click:: {where}", f"   :prog: pyfric {name}"]
            lines += [f"   :nested: {nested}", "```", ""]
        page = folder / f"{section.lower().replace(' ', '_')}.md"
        page.write_text("\n".join(lines), encoding="utf-8")


ROOT = Path(__file__).parents[1]
shown = {}
tried = stored("plans/plans.csv")
write_commands()
myst_substitutions = {
    "held": held(),
    "builds": builds(stored("speed/finer.csv")),
    "curves": curves(stored("curves/curves.csv")),
    "finer": finer(stored("speed/finer.csv")),
    "half_step": half_step(
        "half_step.csv", ["alpha", "tau_bar", "class", "v/c", "v/c, half the step"]
    ),
    "half_step_lines": half_step(
        "half_step_lines.csv", ["line", "alpha", "tau_bar", "tau_bar, half the step"]
    ),
    "laws_of_curves": laws_of_curves(stored("curves/laws.csv")),
    "method_costs": method_costs(stored("chart/price_points.csv")),
    "modules": modules(),
    "prestress": prestress(stored("fronts/collapse.csv"), stored("fronts/resolved_summary.csv")),
    "precursors": precursors(
        stored("precursors/precursors_ends.csv"), stored("precursors/precursors_points.csv")
    ),
    "precursor_scales": precursor_scales(stored("precursors/precursors_collapse.csv")),
    "resolved_checks": resolved_checks(stored("fronts/resolved_checks.csv")),
    "plan_accuracy": plan_accuracy(tried),
    "plan_costs": plan_costs(tried),
    "plans": plans(tried),
    "promises": promises(stored("plans/promises.csv")),
    "regimes": regimes(),
    "run_columns": run_columns(),
    "sticks": sticks(stored("sticks/sticks_programs.csv")),
    "sticks_chain": sticks_chain(stored("sticks/sticks_chain.csv")),
}


TILE = (2.5, 1.75)
"""Size of a tile of the gallery in inches, at 100 pixels each on the page."""


def tile(figure, path, panel):
    """Draw one panel of a figure at the size of a tile, so that its words can be read there."""
    figure = pickle.loads(pickle.dumps(figure))
    shown = figure.axes[panel]
    if shown.axison:
        figure.set_layout_engine("none")
        figure.set_size_inches(*TILE)
        for axes in set(figure.axes) - {shown}:
            axes.set_visible(False)
        for words in (*figure.legends, *figure.texts, *shown.texts, shown.get_legend()):
            words.remove() if words else None
        below = [axes.get_xlabel() for axes in shown.get_shared_x_axes().get_siblings(shown)]
        shown.set_xlabel(next(filter(None, below), ""))
        shown.set_position((0.2, 0.24, 0.76, 0.7))
        shown.set_title("")
        shown.set_title("", loc="left")
        for axis in (shown.xaxis, shown.yaxis):
            axis.label.set_size(7)
            axis.set_tick_params(labelsize=7, labelleft=True, labelbottom=True)
            axis.set_minor_formatter("")
            if axis.get_scale() == "linear":
                axis.set_major_locator(matplotlib.ticker.MaxNLocator(4))
        shown.yaxis.set_label_coords(0.06, 0.5, transform=figure.transFigure)
    figure.savefig(path, dpi=400 / figure.get_figwidth())
    plt.close(figure)


def crop(name, corner):
    """Cut a tile out of a stored picture; the corner is its upper left one, in pixels."""
    with Image.open(ROOT / "examples" / f"{name}.png") as whole:
        x, y = corner
        whole.crop((x, y, x + 380, y + 266)).save(Path(__file__).parent / "_build" / f"{name}.png")


def pictures(block, block_vars, gallery_conf):
    """Show pyfric's figures, which pyplot does not know, beside those of pyplot.

    The first picture of a script is its tile, which its page does not show.
    """
    known = block_vars["example_globals"]
    figure = known.get("figure")
    paths = []
    if "_tiled" not in known and isinstance(figure, matplotlib.figure.Figure):
        known["_tiled"] = True
        script = Path(block_vars["src_file"]).read_text(encoding="utf-8")
        found = re.search(r"(?m)^# sphinx_gallery_tile = (\d)", script)
        tile(figure, next(block_vars["image_path_iterator"]), int(found[1]) if found else 0)
    if isinstance(figure, pyfric.figures.DataFigure) and figure is not known.get("_shown"):
        known["_shown"] = figure
        path = next(block_vars["image_path_iterator"])
        figure.savefig(path, dpi=110)
        paths.append(path)
    shown = figure_rst(paths, gallery_conf["src_dir"])
    return shown + matplotlib_scraper(block, block_vars, gallery_conf)


def house_style(gallery_conf, name):
    """Let pictures of scripts look like pyfric's figures."""
    ticks = {"direction": "in", "labelsize": house.SMALL}
    colours = house.BLUE, house.VERMILION, house.GREEN, house.ORANGE, house.PURPLE, house.BLACK
    matplotlib.rc("font", size=house.BODY)
    matplotlib.rc("axes", linewidth=0.6, prop_cycle=matplotlib.cycler(color=colours))
    matplotlib.rc("lines", linewidth=1.2, markersize=4)
    matplotlib.rc("xtick", top=True, **ticks)
    matplotlib.rc("ytick", right=True, **ticks)
    matplotlib.rc("legend", fontsize=house.SMALL, frameon=False)
    matplotlib.rc("figure", figsize=(4.8, 3.2))
    matplotlib.rc("savefig", dpi=160)


(ROOT / "docs" / "_build").mkdir(exist_ok=True)
crop("precursors_setup2", (0, 187))

# Every script of examples/ that is called plot_* is run; pictures and printed lines make its page.
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "within_subsection_order": "ExampleTitleSortKey",
    "min_reported_time": 1,
    "image_scrapers": (pictures,),
    "reset_modules": ("matplotlib", house_style),
    "capture_repr": ("_repr_html_",),
    "show_memory": False,
    "matplotlib_animations": False,
    "nested_sections": False,
}

doctest_global_setup = "import numpy as np\nimport pyfric"
doctest_default_flags = doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL

html_theme = "pydata_sphinx_theme"
html_title = f"pyfric {release}"
html_logo = html_favicon = "logo.svg"
html_theme_options = {
    "logo": {"text": "pyfric"},
    "navbar_align": "left",
    "header_links_before_dropdown": 8,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {"index": []}
html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"  # without a script, and without a network

# Finished runs of examples are kept here, so that a second build is fast.
os.environ.setdefault("PYFRIC_CACHE", str(Path(__file__).parent / "_build" / "runs"))


def plain_bars(app, what, name, obj, options, lines):
    """|f| in a docstring is an absolute value, not a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def start_pages(app):
    """Run the Python blocks of tutorials and explanations, two pages at a time."""
    if app.builder.name == "html":
        pool, walk, source = ThreadPoolExecutor(2), ROOT / "tests" / "walk.py", Path(app.srcdir)
        for page in sorted([*source.glob("tutorials/*.md"), *source.glob("explanation/*.md")]):
            if "```python" in page.read_text(encoding="utf-8"):
                words = [sys.executable, walk, page, source / "_build" / "shown", source]
                how = {"check": True, "stdout": subprocess.PIPE, "text": True}
                done = pool.submit(subprocess.run, words, **how)
                shown[f"{page.parent.name}/{page.stem}"] = done


def show_page(app, name, source):
    """Show what the blocks of a page print and draw."""
    if name in shown:
        source[0] = shown[name].result().stdout


def always_new(app, env, added, changed, removed):
    """These pages are made again at each build: what they show depends on pyfric."""
    return [name for name in env.found_docs if name in shown]


def mathml(writer, node):
    """Write an equation as MathML."""
    display = "inline" if node.tagname == "math" else "block"
    writer.body.append(latex2mathml.converter.convert(node.astext(), display=display))
    raise nodes.SkipNode


def setup(app):
    app.connect("env-get-outdated", always_new)
    app.connect("builder-inited", start_pages, priority=1)
    app.connect("source-read", show_page)
    app.connect("autodoc-process-docstring", plain_bars)
    app.add_html_math_renderer("mathml", (mathml, None), (mathml, None))

"""Blocks of README, front page, how-to pages and one tutorial, run in order.

Blocks run unchanged in an empty folder. The site runs all tutorials, to show their output and
figures.
"""

import subprocess
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from walk import blocks, run, shown

pytestmark = pytest.mark.site

ROOT = Path(__file__).parents[1]
HOW_TO = sorted((ROOT / "docs" / "howto").glob("*.md"))
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
FRONT = [ROOT / "README.md", ROOT / "docs" / "index.md"]
PAGES = [*FRONT, ROOT / "docs" / "tutorials" / "how_far.md", *HOW_TO]


LONG = {
    "README": "slow",
    "index": "site",
    "my_block": "site",
    "seeds": "site",
    "sweep_again": "site",
}
"""Pages that take seconds; `make docs` runs them."""


def walked(page):
    marks = [getattr(pytest.mark, LONG[page.stem])] if page.stem in LONG else []
    return pytest.param(page, marks=marks, id=page.stem)


@pytest.mark.parametrize("page", [walked(page) for page in PAGES])
def test_a_newcomer_can_run_every_block(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "kept"))
    known = {"__name__": "__main__"}
    for kind, text in blocks(page):
        run(kind, text, known)
    plt.close("all")


def test_every_page_has_blocks():
    assert len(TUTORIALS) >= 7
    assert len(HOW_TO) >= 14
    assert all(blocks(page) for page in [*PAGES, *TUTORIALS])


def test_a_block_that_fails_is_noticed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for kind, text in (("python", "1 / 0"), ("sh", "pyfric run nothing --t-end 1")):
        with pytest.raises((ZeroDivisionError, subprocess.CalledProcessError)):
            run(kind, text, {})


def test_another_output_is_noticed():
    known = {}
    run("python", "print(1 / 3)", known)
    run("text", "0.33...\n", known)
    with pytest.raises(AssertionError, match=r"is not\n *0\.33"):
        run("text", "0.34...\n", known)


def test_the_site_shows_what_a_block_prints_and_draws(tmp_path):
    draw = "import matplotlib.pyplot as plt\nplt.figure()\nplt.savefig('one.png')\nprint(6 * 7)\n"
    files = "```toml\n# a.toml\nb = 1\n```\n\n```sh\ncat a.toml\n```\n"
    text = f"Before\n\n```python\n{draw}```\n\n{files}"
    page = shown(text, tmp_path / "page", tmp_path)
    plt.close("all")
    assert page.startswith("Before\n\n```python\n")
    assert "```{code-block} text\n:class: output\n\n42\n```\n\n```{image} /page/one.png\n" in page
    assert page.endswith(":class: output\n\n# a.toml\nb = 1\n```\n")
    with pytest.raises(ZeroDivisionError):
        shown("```python\n1 / 0\n```\n", tmp_path / "page", tmp_path)

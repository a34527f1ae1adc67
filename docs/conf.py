"""The documentation site: `make docs` builds it into docs/_build/html; warnings are errors."""

import doctest
import os
import sys
from pathlib import Path

from sphinx_gallery.scrapers import figure_rst, matplotlib_scraper

import pyfric

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

exclude_patterns = ["_build", "gallery/GALLERY_HEADER.md"]
suppress_warnings = ["config.cache"]
nitpicky = False

# Pages are Markdown, with the paper's letters as they are; tables of reference_data are included.
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist", "substitution"]
myst_heading_anchors = 3
smartquotes = False  # it would turn --json into a dash

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_format = "short"
autosummary_generate = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False


def held():
    """Return what a record holds as a table."""
    lines = ["| group | name | dimensions | unit | meaning |", "|---|---|---|---|---|"]
    for group in pyfric.record.GROUPS:
        for one in pyfric.record.held_in(group).values():
            cells = group, f"`{one.name}`", ", ".join(one.dims), one.unit, one.meaning
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


myst_substitutions = {"held": held()}


def pictures(block, block_vars, gallery_conf):
    """Show pyfric's figures, which pyplot does not know, beside those of pyplot."""
    known = block_vars["example_globals"]
    figure = known.get("figure")
    paths = []
    if isinstance(figure, pyfric.figures.DataFigure) and figure is not known.get("_shown"):
        known["_shown"] = figure
        path = next(block_vars["image_path_iterator"])
        figure.savefig(path, dpi=110)
        paths.append(path)
    shown = figure_rst(paths, gallery_conf["src_dir"])
    return shown + matplotlib_scraper(block, block_vars, gallery_conf)


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
    "show_memory": False,
    "matplotlib_animations": False,
    "nested_sections": False,
}

doctest_global_setup = "import numpy as np\nimport pyfric"
doctest_default_flags = doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL

html_theme = "pydata_sphinx_theme"
html_title = f"pyfric {release}"
html_theme_options = {
    "navbar_align": "left",
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {"**": []}  # sections have no pages below them
html_show_sourcelink = False

# Finished runs of examples are kept here, so that a second build is fast.
os.environ.setdefault("PYFRIC_CACHE", str(Path(__file__).parent / "_build" / "runs"))


def plain_bars(app, what, name, obj, options, lines):
    """|f| in a docstring is an absolute value, not a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app):
    app.connect("autodoc-process-docstring", plain_bars)

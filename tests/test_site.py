"""The built site: titles, navigation, thumbnails, links and pictures. `make docs` builds it."""

import re
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import browser
import pytest

SITE = Path(__file__).parents[1] / "docs" / "_build" / "html"
SECTIONS = ["Tutorials", "How-to", "Gallery", "Explanation", "API", "Studies"]
WIDTHS = (1300, 800)

pytestmark = pytest.mark.site


@pytest.fixture(scope="module")
def pages():
    assert (SITE / "index.html").exists(), "make docs builds the site"
    return {
        path: path.read_text(encoding="utf-8")
        for path in sorted(SITE.rglob("*.html"))
        if "_static" not in path.parts
    }


def test_every_page_has_a_title(pages):
    assert len(pages) > 100
    for path, text in pages.items():
        title = unescape(re.search(r"<title>(.*?)</title>", text, re.DOTALL)[1])
        assert title.split("—")[0].strip(), path
        assert "no title" not in unescape(text), path
        assert not re.search(r"<p># \w", text), f"{path}: Markdown that was not read"


def test_every_section_is_in_the_head_of_every_page(pages):
    for path, text in pages.items():
        head = re.search(r'<div class="bd-header.*?</header>|<header.*?</header>', text, re.DOTALL)
        if path.name != "search.html":
            assert all(re.search(rf">\s*{name}\s*<", head[0]) for name in SECTIONS), path


def test_the_gallery_has_no_placeholder(pages):
    text = pages[SITE / "gallery" / "index.html"]
    shown = re.findall(r'<img[^>]*src="([^"]*thumb[^"]*)"', text)
    assert len(shown) > 10
    contents = [(SITE / "gallery" / unquote(path)).read_bytes() for path in shown]
    assert len({*contents}) == len(contents)
    import sphinx_gallery

    empty = Path(sphinx_gallery.__file__).parent / "_static" / "no_image.png"
    assert empty.read_bytes() not in contents


def test_links_and_pictures_are_there(pages):
    for path, text in pages.items():
        for link in re.findall(r'(?:href|src)="([^"#?]+)', text):
            if not re.match(r"\w+:|//", link):
                assert (path.parent / unquote(unescape(link))).exists(), f"{path}: {link}"


def test_tutorials_show_output_and_pictures(pages):
    shown = {path: text for path, text in pages.items() if path.parent.name == "tutorials"}
    assert len(shown) == 6
    for path, text in shown.items():
        assert re.search(r'<div class="output highlight-text', text), path
        assert re.search(r'<img[^>]*src="\.\./_images/', text), path


def test_no_equation_waits_for_a_script(pages):
    assert any("<math" in text for text in pages.values())
    for path, text in pages.items():
        assert not re.search(r"<script[^>]*mathjax", text, re.IGNORECASE), path
        assert r"\(" not in re.sub(r"<pre>.*?</pre>|<script.*?</script>", "", text, flags=re.DOTALL)


@pytest.mark.skipif(browser.FOUND is None, reason="no Chromium")
def test_pages_fit_and_have_no_error(tmp_path):
    one = browser.Browser(tmp_path / "profile")
    try:
        for name in (
            "index",
            "tutorials/first_run",
            "explanation/model",
            "gallery/index",
            "commands/simulate",
        ):
            for width in WIDTHS:
                size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
                one("Emulation.setDeviceMetricsOverride", **size)
                one.events.clear()
                one.open(SITE / f"{name}.html")
                assert one.js("document.documentElement.scrollWidth") <= width, (name, width)
                bad = "[...document.images].filter(x => x.complete && !x.naturalWidth).length"
                assert one.js(bad) == 0, name
                errors = [x for x in one.events if x["method"] == "Runtime.exceptionThrown"]
                assert not errors, (name, errors)
    finally:
        one.close()

"""The built site: titles, navigation, thumbnails, links and pictures. `make docs` builds it."""

import re
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import browser
import numpy as np
import pytest
from PIL import Image

SITE = Path(__file__).parents[1] / "docs" / "_build" / "html"
SECTIONS = ["Tutorials", "How-to", "Gallery", "Explanation", "API", "Studies"]
SCREENS = Path(__file__).with_name("screens")
WIDTHS = (1300, 800)
TEXT = 229.3
"""Width of a text in the fonts of the stored screens, in pixels."""
LOOKED_AT = (
    "index",
    "tutorials/first_run",
    "explanation/model",
    "gallery/index",
    "commands/simulate",
)

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


def test_no_page_shows_an_address_in_memory(pages):
    """Examples are a legend at the end of a block, or a function as a default."""
    shown = {str(path) for path, text in pages.items() if re.search(r" at 0x[0-9a-f]{4}", text)}
    assert not shown


def test_links_and_pictures_are_there(pages):
    for path, text in pages.items():
        for link in re.findall(r'(?:href|src)="([^"#?]+)', text):
            if not re.match(r"\w+:|//", link):
                assert (path.parent / unquote(unescape(link))).exists(), f"{path}: {link}"


def test_tutorials_show_output_and_pictures(pages):
    shown = {path: text for path, text in pages.items() if path.parent.name == "tutorials"}
    assert len(shown) == 7
    for path, text in shown.items():
        assert re.search(r'<div class="output highlight-text', text), path
        assert re.search(r'<img[^>]*src="\.\./_images/', text), path


def test_no_equation_waits_for_a_script(pages):
    assert any("<math" in text for text in pages.values())
    for path, text in pages.items():
        assert not re.search(r"<script[^>]*mathjax", text, re.IGNORECASE), path
        assert r"\(" not in re.sub(r"<pre>.*?</pre>|<script.*?</script>", "", text, flags=re.DOTALL)


@pytest.fixture
def page(tmp_path):
    if browser.FOUND is None:
        pytest.skip("no Chromium")
    one = browser.Browser(tmp_path / "profile")
    yield one
    one.close()


def opened(page, name, width, scheme="light"):
    """Open a page of the site in a window of this width."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    page("Emulation.setDeviceMetricsOverride", **size)
    wanted = {"name": "prefers-color-scheme", "value": scheme}
    page("Emulation.setEmulatedMedia", features=[wanted])
    page.events.clear()
    page.open(SITE / f"{name}.html")


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", LOOKED_AT)
def test_pages_fit_and_have_no_error(page, name, width):
    opened(page, name, width)
    assert page.js("document.documentElement.scrollWidth") <= width
    assert page.js("[...document.images].filter(x => x.complete && !x.naturalWidth).length") == 0
    assert not [x for x in page.events if x["method"] == "Runtime.exceptionThrown"]


WIDTH_OF_TEXT = """(() => {
    const canvas = document.createElement("canvas").getContext("2d");
    canvas.font = getComputedStyle(document.body).font;
    return canvas.measureText("From static to kinetic friction").width;
})()"""


@pytest.mark.parametrize("name", LOOKED_AT)
def test_the_first_screen_looks_as_before(page, name, tmp_path):
    """Greys of squares of 50 pixels agree, light and dark, at both widths.

    Another font changes greys by 0.004 on average (0.011 at most), a missing navigation or picture
    by 0.016 to 0.03, and the other colours by 0.6. To renew a stored screen, remove its file.
    """
    screens = []
    for width in WIDTHS:
        for scheme in ("light", "dark"):
            opened(page, name, width, scheme)
            if page.js(WIDTH_OF_TEXT) != pytest.approx(TEXT, rel=0.01):
                pytest.skip("other fonts, which break lines elsewhere")
            page.picture(tmp_path / "screen.png")
            with Image.open(tmp_path / "screen.png") as screen:
                grey = screen.convert("L").resize((width // 50, 18), Image.Resampling.BOX)
            screens.append(np.asarray(grey))
    now = np.hstack(screens)
    stored = SCREENS / f"{name.replace('/', '_')}.png"
    if not stored.exists():
        stored.parent.mkdir(exist_ok=True)
        Image.fromarray(now).save(stored)
        pytest.fail(f"{stored.name} is new: look at the page and run again")
    with Image.open(stored) as before:
        change = np.abs(now - np.asarray(before, float)) / 255
    edges = np.cumsum([screen.shape[1] for screen in screens])[:-1]
    assert max(part.mean() for part in np.hsplit(change, edges)) < 0.015

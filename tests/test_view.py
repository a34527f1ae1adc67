"""The page of a record: its content, no other files, and its behaviour in a browser."""

import json
import re

import browser
import numpy as np
import pytest
from click.testing import CliRunner
from helpers import small
from test_page import Page

import pyfric
from pyfric import paper
from pyfric.cli.commands import main
from pyfric.figures import record_page, view
from pyfric.figures.view import drawing
from pyfric.record import held_in


@pytest.fixture(scope="module")
def record():
    return pyfric.simulate(
        small(name="<b>&", V=0.02), 0.1, fidelity="hybrid", geometry="linear", progress=False
    )


@pytest.fixture(scope="module")
def text(record):
    return record_page(record)


def embedded(text):
    return json.loads(re.search(r'id="data">(.*?)</script>', text).group(1))


def test_it_stands_alone(record, text, tmp_path):
    path = record.to_html(tmp_path / "run.html")
    assert path.read_text(encoding="utf-8") == text
    assert len(text.encode()) < 2_000_000
    page = Page(text)
    assert all(link.startswith("#") for link in page.links)
    for elsewhere in ("http", "url(", "@import", "import(", "fetch", "<link", "<img", "<b>"):
        assert elsewhere not in text
    assert "Run of <b>&" in page.texts  # escaped
    assert {"overview", "event", "events", "numbers", "errors", "made"} <= set(page.ids)


def test_it_holds_what_the_record_does(record, text):
    words, data = " ".join(Page(text).texts), embedded(text)
    assert len(record.events) > 5
    assert [one["event"] for one in data["events"]] == list(record.events.index)
    assert data["details"].keys() == set(map(str, record.events.index))
    F_N, order = record.scene.F_N, np.argsort(record.scene.n_of_i)
    for one, (number, event) in zip(data["events"], record.events.iterrows(), strict=True):
        assert f'href="#event-{number}"' in text
        assert one["t"] == pytest.approx(event["t_start"], rel=1e-8)
        assert one["start"] == pytest.approx(event["F_T_start"] / F_N, rel=1e-5)
        detail, unit = data["details"][str(number)], F_N / record.scene.N_x
        known = [np.nan if v is None else v for v in detail["tau_after"]]
        expected = record.tau_after[number - 1][order] / unit
        assert known == pytest.approx(expected, rel=1e-3, nan_ok=True)
        columns = [np.nan if v is None else v for v in detail["columns"]]
        assert columns == pytest.approx(event.to_numpy(float), rel=1e-5, nan_ok=True)
        slips = record.episodes[record.episodes["event"] == number]
        assert sum(one[3] for one in detail["slips"]) == pytest.approx(
            slips["slip"].sum() * record.scene.d * 1e9, rel=1e-4
        )
    for said in (*record.notes, *record.versions.values(), str(record.method)[1:]):
        assert said in words
    assert "errors not measured (a planned run" in words
    for name in record.events:
        assert f'<th scope="row">{name}</th>' in text
    for group in ("curve", "events", "episodes", "interface", "quiet", "switches"):
        for held in held_in(group).values():
            assert held.meaning in words


def test_drawings_have_words(text):
    for name in re.findall(r'aria-(?:labelledby|describedby)="(.*?)"', text):
        assert all(f'id="{one}"' in text for one in name.split())
    assert len(re.findall("<svg", text)) == 3
    assert len(re.findall('<svg[^>]*(?:aria-label|role="img" aria-labelledby)="', text)) == 3


def test_a_page_never_grows_beyond_its_size(record, text, monkeypatch):
    monkeypatch.setattr(view, "LARGEST", len(text.encode()) - 10_000)
    monkeypatch.setattr(view, "SPARE", 1000)
    shorter = record_page(record)
    assert len(shorter.encode()) <= view.LARGEST
    kept = {int(row) for row in embedded(shorter)["details"]}
    left = set(record.events.index) - kept
    assert left
    assert f"no drawings of {len(left)} events, those of the fewest blocks" in shorter
    blocks = record.events["n_blocks"]
    assert blocks[list(kept)].min() >= blocks[list(left)].max()
    monkeypatch.setattr(view, "MOST_EVENTS", 3)
    assert len(embedded(record_page(record))["events"]) == 3


def test_a_run_without_slip():
    still = pyfric.simulate(small(), 1e-4, fidelity="hybrid", geometry="linear", progress=False)
    assert "Nothing slipped in this run." in record_page(still)


def test_a_prediction_shows_length_against_force():
    record = pyfric.prediction_curve(small())
    shown = embedded(record_page(record))
    assert shown["growth"] == pytest.approx(list(record.curve["L_p_over_L"]), rel=1e-4)
    line = drawing(record).axes[0].lines[0]
    np.testing.assert_array_equal(line.get_ydata(), record.curve["L_p_over_L"])
    np.testing.assert_array_equal(line.get_xdata(), record.curve["F_T"] / record.scene.F_N)


def test_the_command(record, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record.save("run.nc")
    runs = CliRunner()
    assert runs.invoke(main, ["show", "run.nc"]).output == "run.html\n"
    again = runs.invoke(main, ["show", "run.nc"])
    assert (again.exit_code, "--overwrite replaces it" in again.output) == (2, True)
    told = runs.invoke(main, ["show", "run.nc", "--overwrite", "--json"]).output
    assert json.loads(told)["files"] == ["run.html"]
    assert runs.invoke(main, ["show", "none.nc"]).exit_code == 2


@pytest.fixture
def page(record, tmp_path):
    if browser.FOUND is None:
        pytest.skip("there is no Chromium here (Debian: apt-get install chromium)")
    one = browser.Browser(tmp_path / "profile")
    one.open(record.to_html(tmp_path / "run.html"))
    yield one
    one.close()


def test_in_a_browser(record, page):
    said = 'document.getElementById("said").textContent'

    def shown():
        return int(re.match(r"Event (\d+):", page.js(said)).group(1))

    blocks, main = record.events["n_blocks"], record.events["is_main"]
    assert shown() == blocks[main & record.events["is_precursor"]].idxmax() != blocks.idxmax()
    words = page.js('document.getElementById("stress").textContent')
    assert "before" in words
    assert "after" in words
    box = "JSON.stringify(document.getElementById('map').getBoundingClientRect())"
    box, row = json.loads(page.js(box)), int(record.events["is_main"].idxmax())
    span = record.curve["t"].iloc[-1]
    at = 62 + 825 * record.events["t_start"][row] / span
    page.click(box["x"] + at * box["width"] / 900, box["y"] + 300 * box["height"] / 470)
    assert abs(record.events["t_start"][shown()] - record.events["t_start"][row]) < 0.02 * span
    assert page.js("document.activeElement.id") == "map"  # keys go to the map now
    page.press("Home")
    assert shown() == 1
    page.press("ArrowRight")
    page.press("ArrowRight")
    assert shown() == 3
    page.press("End")
    assert shown() == len(record.events)
    assert page.js("document.getElementById('next').disabled")
    page.press("PageUp")
    assert record.events["is_main"][shown()]
    assert page.js("document.getElementById('map').getAttribute('aria-valuetext')") == page.js(said)
    page.press("Tab")
    assert page.js("document.activeElement.id") == "previous"
    before = shown()
    page.press("Enter", "\r")
    assert shown() == before - 1
    page.js("location.hash = '#event-2'")
    page.js("new Promise((done) => setTimeout(done, 50))")
    assert shown() == 2
    slips = (record.episodes["event"] == 2).sum()
    assert page.js("document.querySelectorAll('#xt rect').length") >= slips
    assert page.js("document.querySelectorAll('#stress path.line').length") == 12
    told = {one["method"] for one in page.events}
    assert "Runtime.exceptionThrown" not in told
    assert "Log.entryAdded" not in told
    asked = [e["params"]["request"]["url"] for e in page.events if "request" in e.get("params", {})]
    assert asked
    assert all(url.startswith("file://") for url in asked)
    named = page("Accessibility.getFullAXTree")["nodes"]
    named = {(one["role"]["value"], one["name"]["value"]) for one in named if "name" in one}
    assert ("slider", "Events in order of time") in named
    assert {name for role, name in named if role == "button"} == {"Previous", "Next"}


CONTRAST = """(() => {
    const canvas = new OffscreenCanvas(1, 1).getContext("2d");
    const light = (colour) => {
        canvas.fillStyle = colour;
        canvas.fillRect(0, 0, 1, 1);
        const line = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
        const [r, g, b] = [...canvas.getImageData(0, 0, 1, 1).data].map((x) => line(x / 255));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const of = (one) => getComputedStyle(one);
    const behind = (one) => {
        const own = of(one).backgroundColor;
        return own === "rgba(0, 0, 0, 0)" && one.parentElement ? behind(one.parentElement) : own;
    };
    const drawn = (one) => (one.matches("svg text, svg circle") ? of(one).fill : of(one).color);
    const shown = (one) => (one.matches("svg path.line") ? of(one).stroke : drawn(one));
    const which = "p, th, td, a, h1, li, svg text, svg path.line, svg circle";
    const all = [...document.querySelectorAll(which)];
    const known = all.filter((one) => one.checkVisibility() && shown(one) !== "none");
    return known.map((one) => {
        const [a, b] = [light(shown(one)), light(behind(one))];
        return [one.tagName, (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05)];
    });
})()"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_can_be_read_in_the_dark(page, tmp_path, scheme):
    """Contrasts reach those of WCAG, 4.5 for text and 3 for lines, also in the row of a miss."""
    claims = {"claims": [{"number": "2", "text": "more", "verdict": "misses", "how": "by eye"}]}
    (tmp_path / "claims.json").write_text(json.dumps(claims), encoding="utf-8")
    paper.write_index(tmp_path)
    wanted = {"name": "prefers-color-scheme", "value": scheme}
    page("Emulation.setEmulatedMedia", features=[wanted])
    for name in ("run.html", "index.html"):
        page.events.clear()
        page.open(tmp_path / name)
        back = page.js("getComputedStyle(document.body).backgroundColor")
        assert (sum(map(int, re.findall(r"\d+", back))) < 200) is (scheme == "dark")
        found = page.js(CONTRAST)
        assert len(found) > 10
        for tag, contrast in found:
            assert contrast > (4.5 if tag in ("P", "TH", "TD", "A", "H1", "LI", "text") else 3), tag

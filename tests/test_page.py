"""The folder of figures and its page, which shows all files with captions, costs and claims."""

import json
import re
from html.parser import HTMLParser

import pandas as pd
import pytest

import pyfric
from pyfric.figures import FIGURES
from pyfric.paper import reproduce, write_index
from pyfric.paper import runs as paper
from pyfric.paper.reproduction import mathematical
from pyfric.sweeps import Job

OPTIONS = {"fidelity": "hybrid", "geometry": "linear"}


def job(t_end=0.11, **changes):
    own = {"L": 0.07, "H": 0.0375, "V": 5e-3, "F_N": 1750.0, "name": "small <1>"}
    return Job(scene=pyfric.setup1(**own | changes), t_end=t_end, options=OPTIONS)


RUNS = {
    "fig1": job(),
    "fig2a": (job(), job(h=7.5e-3, name="higher")),
    "fig2b": (Job(scene=pyfric.setup2(L=0.05, H=0.01, V=5e-3), t_end=0.05, options=OPTIONS),),
}
NAMES = ("fig1b", "fig2a", "fig2b", "fig3b")


class Page(HTMLParser):
    """Parser of texts, tags and links of a page; tags have to close in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.links, self.texts, self.ids = [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.links += [attributes[name] for name in ("href", "src") if name in attributes]
        self.ids += [attributes["id"]] if "id" in attributes else []
        if tag not in ("meta", "img", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pyfric.paper.reproduction.RUNS", RUNS)
        files = reproduce(NAMES, out / "new" / "figures", workers=1, cache=out / "kept")
    assert len(list((out / "kept").glob("*.nc"))) == 3  # shared runs are made once
    assert all(path.stat().st_size > 0 for path in files)
    assert {path.name for path in files} == {
        path.name for path in (out / "new" / "figures").iterdir()
    }
    return out / "new" / "figures"


def test_every_figure_has_its_files(folder):
    for name in NAMES:
        for suffix in (".png", ".pdf", ".txt", "_runs.csv"):
            assert (folder / f"{name}{suffix}").is_file()
    assert (folder / "fig2a_points.csv").is_file()


def test_page_shows_every_figure_with_caption_and_links(folder):
    text = (folder / "index.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.ids == [*NAMES, "cost"]
    words = " ".join(" ".join(page.texts).split())
    for name in NAMES:
        caption = (folder / f"{name}.txt").read_text(encoding="utf-8")
        for part in caption.split("\n", 1):
            assert plain(mathematical(part)) in plain(text)
        assert "Method: " not in caption.split("\n", 1)[0]
        wanted = {f"{name}.png", f"{name}.pdf", *(p.name for p in folder.glob(f"{name}_*.csv"))}
        assert wanted <= set(page.links)
    inside = [link[1:] for link in page.links if link.startswith("#")]
    assert inside == page.ids  # links of the contents
    outside = [link for link in page.links if not link.startswith("#")]
    assert all((folder / link).is_file() for link in outside)  # no file from elsewhere
    assert "http" not in text
    assert pyfric.__version__ in words


def plain(html):
    """Return text without tags and spaces."""
    return re.sub(r"<[^>]*>|\s", "", html)


def test_symbols_are_mathematics():
    symbol = "<math><msub><mi>{}</mi><mi>{}</mi></msub></math>"
    alone = "<math><mi>{}</mi></math>".format
    assert (
        mathematical("57 x 31 blocks, 3500 N, x = 2") == f"57 x 31 blocks, 3500 N, {alone('x')} = 2"
    )
    assert mathematical("L_p/L < mu_s p: tau, k_top, F_N/N_x of fig1_runs.csv") == (
        f"{symbol.format('L', 'p')}/{alone('L')} &lt; {symbol.format('μ', 's')} {alone('p')}: "
        f"{alone('τ')}, "
        f"{symbol.format('k', 'top')}, {symbol.format('F', 'N')}/{symbol.format('N', 'x')} "
        "of fig1_runs.csv"
    )


def test_a_film_is_shown_where_it_is(folder):
    film, text = folder / "event.mp4", folder / "event.txt"
    film.touch()
    text.write_text("the event of L_p", encoding="utf-8")
    try:
        page = write_index(folder).read_text(encoding="utf-8")
    finally:
        film.unlink()
        text.unlink()
    assert '<video src="event.mp4" controls' in page
    assert "theeventofLp" in plain(page)
    assert "<video" not in write_index(folder).read_text(encoding="utf-8")


def test_cost_lists_every_run_once(folder):
    tables = [pd.read_csv(folder / f"{name}_runs.csv") for name in NAMES]
    runs = pd.concat(tables).drop_duplicates()
    assert len(runs) == 3
    words = " ".join(Page((folder / "index.html").read_text(encoding="utf-8")).texts)
    assert f"3 runs, {runs['seconds'].sum():.1f} s of processor time" in words
    assert "fig1b, fig2a, fig3b" in words
    assert (runs["engine"] == "hybrid").all()
    assert (runs["block_evaluations"] > 0).all()


def test_claims_are_shown_where_they_are_there(folder):
    first = {"number": "1", "text": "a <b> & c", "value": 0.1, "band": "0 to 1"}
    unit = "(mu_s - mu_k)"
    rows = [
        first | {"verdict": "holds", "unit": unit, "damage": "worse", "damaged": 3},
        {"number": "2", "text": "more", "value": None, "verdict": "misses", "how": "by eye"},
    ]
    claims = folder / "claims.json"
    claims.write_text(json.dumps({"claims": rows}), encoding="utf-8")
    try:
        text = write_index(folder).read_text(encoding="utf-8")
    finally:
        claims.unlink()
    page = Page(text)
    assert page.ids == [*NAMES, "claims", "cost"]
    words = [one.strip() for one in page.texts]
    for one in ("a <b> & c", "not measured", "by eye", "verdict"):
        assert one in words
    for one in ("0.1(μs−μk)", "0to1(μs−μk)", "worse:3(μs−μk)"):
        assert one in plain(text)
    assert "1 of 2 claims hold" in text
    assert "hold; outside their bands: 2." in text
    assert words.index("by eye") < words.index("a <b> & c")  # misses come first
    assert len(re.findall('<tr class="miss">', text)) == 1
    assert "claims" not in Page(write_index(folder).read_text(encoding="utf-8")).ids


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"claims": 1}', '{"claims": [1]}'])
def test_a_damaged_file_of_claims_is_named(tmp_path, text):
    (tmp_path / "claims.json").write_text(text, encoding="utf-8")
    page = Page(write_index(tmp_path).read_text(encoding="utf-8"))
    assert "claims.json holds no claims." in page.texts


def test_page_of_an_empty_folder(tmp_path):
    page = Page(write_index(tmp_path).read_text(encoding="utf-8"))
    assert page.ids == []


def test_unknown_figures_are_refused(tmp_path):
    with pytest.raises(pyfric.SceneError, match=r"fig2.*fig2a"):
        reproduce(["fig2"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_every_figure_has_runs():
    assert {one.runs for one in FIGURES.values()} == set(paper.RUNS)
    assert sorted(FIGURES) == [
        "fig1a",
        "fig1b",
        "fig2a",
        "fig2b",
        "fig3a",
        "fig3b",
        "fig4a",
        "fig4b",
    ]


def test_the_paper_s_scenes():
    scenes = [job.scene for job in paper.FIG2A.values()]
    assert {one.slider.L for one in scenes} == {0.14, 0.2}
    assert {one.F_N for one in scenes} == {1750, 2700, 3500}
    assert {one.driver.h for one in scenes} == {2.5e-3, 5e-3, 7.5e-3, 10e-3, 12.5e-3, 15e-3}
    linear = [job.scene.F_N for job in paper.FIG2A.values() if job.options.geometry == "linear"]
    assert set(linear) == {2700}, "there F_N is only a scale"
    assert len(linear) == 12
    assert [job.scene.top.theta for job in paper.FIG2B] == [-0.833, 0, 0.833]
    assert [job.scene for job in paper.FIG4B] == [
        pyfric.preset(name) for name in ("run1", "run2", "run3", "run4")
    ]
    assert paper.FIG1.scene == pyfric.preset("fig1")

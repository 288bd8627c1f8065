"""The report: one file, answer first, numbers as the estimate has them."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

import ulna  # noqa: E402
from ulna.record import join  # noqa: E402
from ulna.report import (  # noqa: E402
    _shape_words,
    digits_after_point,
    number,
    percent,
    value_and_interval,
)

ROOT = Path(__file__).resolve().parents[2]
_VOID = {"meta", "img", "br", "link", "hr", "input"}


class Altered:
    """An estimate or verdict with some of its fields replaced."""

    def __init__(self, original, **changes):
        self.__dict__.update(_of=original, **changes)

    def __getattr__(self, name):
        return getattr(self.__dict__["_of"], name)


class Page(HTMLParser):
    """Checks that tags close in order and collects images, references and text."""

    def __init__(self, text):
        super().__init__()
        self.open, self.images, self.links, self.tags, self.words = [], [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in _VOID:
            self.open.append(tag)
        found = dict(attributes)
        if tag == "img":
            self.images.append(found)
        self.links += [found[key] for key in ("src", "href") if key in found]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self):
        return " ".join("".join(self.words).split())


@pytest.fixture(scope="module")
def arm():
    return ulna.identify_impedance(ulna.read(ROOT / "examples" / "data" / "relaxed-arm.csv"))


@pytest.fixture(scope="module")
def page(arm, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "made" / "trial.html"
    assert ulna.report(arm, path, source="relaxed-arm.csv", command="ulna assess x") == path
    return path.read_text(encoding="utf-8")


def _without_figures(estimate, path, **options):
    ulna.report(estimate, path, figures=(), **options)
    return path.read_text(encoding="utf-8")


def test_needs_nothing_but_itself(page):
    read = Page(page)
    assert "script" not in read.tags and "link" not in read.tags
    assert all(link.startswith("data:image/svg+xml;base64,") for link in read.links)
    style = page[page.index("<style>") : page.index("</style>")]
    assert "url(" not in style and "@import" not in style


def test_figures_are_whole_and_described(page):
    images = Page(page).images
    assert len(images) == 7
    for image in images:
        assert len(image["alt"]) > 30
        svg = ElementTree.fromstring(base64.b64decode(image["src"].split(",", 1)[1]))
        assert svg.tag == "{http://www.w3.org/2000/svg}svg"


def test_the_answer_comes_first(arm, page):
    text = Page(page).text
    places = [
        text.index(arm.passivity().verdict.capitalize()),
        text.index("Parameters"),
        text.index("What would change it"),
        text.index("Figures"),
        text.index("How it was done"),
    ]
    assert places == sorted(places)


def test_numbers_are_those_of_the_estimate(arm, page):
    text = Page(page).text
    for name in ("M", "B", "K"):
        low, high = arm.interval(name)
        for i in range(2):
            for j in range(2):
                spread = getattr(arm, name + "_se")[i, j]
                shown = number(getattr(arm, name)[i, j], spread)
                interval = f"{number(low[i, j], spread)} to {number(high[i, j], spread)}"
                row = f"{shown} {number(spread, spread)} {interval}"
                # Cells of a row follow each other without blanks once tags are gone.
                assert row.replace(" ", "") in text.replace(" ", "")


def test_every_warning_is_in_it(arm, page):
    text = Page(page).text
    for sentence in arm.warnings:
        assert re.sub(r"\b([mbk])_", r"\1", " ".join(sentence.split())) in text


def test_entries_in_a_warning_have_an_index(arm, tmp_path):
    text = _without_figures(
        Altered(arm, warnings=("k_yy < k_xxl",), least_squares=None), tmp_path / "a.html"
    )
    assert '<i class="q">k</i><sub>yy</sub> &lt; k_xxl' in text


def test_what_the_perturbation_caused_is_in_the_answer(arm, page, tmp_path):
    answer = Page(page).text.split("Parameters")[0]
    assert arm.vaf_reference.min() > 99
    for value in arm.vaf_reference:
        assert f"{value:.1f} %" in answer
    assert "what the perturbation caused of the force" in answer
    none = Altered(arm, vaf_reference=np.full(2, np.nan))
    text = _without_figures(none, tmp_path / "none.html")
    assert "the perturbation caused" not in text and "it has not seen." in Page(text).text


def test_fixed_parameters_are_called_fixed(tmp_path):
    log = ulna.read(ROOT / "examples" / "data" / "relaxed-arm.csv")
    with pytest.warns(ulna.UncertainResult):
        text = _without_figures(
            ulna.identify_impedance(log, no_damping=True), tmp_path / "a.html"
        )
    read = Page(text).text
    # Four entries in two columns, two axes of the ellipse and the excess by the model.
    assert read.count("0 (fixed)") == 4 * 2 + 2 + 1
    assert "undefined" in read.split("Ellipses")[1]


def test_trials_have_a_mean_with_its_error(arm, page, tmp_path):
    assert "Each trial" not in page
    log = ulna.read(ROOT / "examples" / "data" / "relaxed-arm.csv")
    halves = join([log.select(stop_s=24.0), log.select(start_s=25.0)])
    estimate = ulna.identify_impedance(halves)
    read = Page(_without_figures(estimate, tmp_path / "a.html")).text
    k_yy = 2 * 4 + 3
    mean, error = estimate.trial_mean[k_yy], estimate.trial_se[k_yy]
    assert f"{number(mean, error)} ± {number(error, error)}" in read
    total = sum(absorbed[-1] for _, absorbed, _ in estimate.passivity().series)
    assert f"{total:.3g} J over 2 trials" in read


@pytest.mark.parametrize(
    "value, minor, words",
    [
        (np.nan, (-1.0, 2.0), "undefined"),
        (np.inf, (0.0, 0.0), "undefined"),
        (4.0, (-1.0, 2.0), "4 [unbounded]"),
        (4.0, (1.0, 2.0), "4.00 [3.00, 5.00]"),
    ],
)
def test_shape_of_an_ellipse_without_a_bound_says_so(value, minor, words):
    shape = SimpleNamespace(shape=value, minor_interval=minor, shape_interval=(3.0, 5.0))
    assert _shape_words(shape) == words


def test_a_folder_is_no_file_to_write(arm, tmp_path):
    with pytest.raises(ulna.ArgumentError, match="is a folder: give the name of the file"):
        ulna.report(arm, tmp_path)


def test_what_least_squares_would_have_said_is_said(arm, page, tmp_path):
    assert "which misleads least squares" in Page(page).text
    calm = Altered(arm, least_squares=Altered(arm.least_squares, outcome="good"))
    assert "misleads" not in _without_figures(calm, tmp_path / "calm.html")


def test_names_cannot_break_the_page(arm, tmp_path):
    text = _without_figures(
        Altered(arm, warnings=("a < b & c",)), tmp_path / "a.html",
        source='<script>alert("x")</script>.csv', title="A & B <i>",
    )  # fmt: skip
    read = Page(text)
    assert "script" not in read.tags and read.tags.count("i") == text.count('<i class="q">')
    assert '<script>alert("x")</script>.csv' in read.text and "a < b & c" in read.text


@pytest.mark.parametrize(
    "verdict, word, colour",
    [("passive", "Passive", "good"), ("not passive", "Not passive", "bad"),
     ("undecided", "Undecided", "open")],
)  # fmt: skip
def test_each_verdict_has_its_word(arm, tmp_path, verdict, word, colour):
    altered = Altered(arm.passivity(), verdict=verdict)
    estimate = Altered(arm, outcome="good", passivity=lambda: altered)
    text = _without_figures(estimate, tmp_path / "v.html")
    assert f'<section class="verdict {colour}"><p class="word">{word}</p>' in text


def test_an_outcome_that_is_not_good_is_said_at_the_top(arm, tmp_path):
    text = _without_figures(Altered(arm, outcome="poor_fit"), tmp_path / "o.html")
    top = text[: text.index("<h2>Parameters")]
    assert "A second-order model does not describe this recording well" in top
    text = _without_figures(Altered(arm, outcome="something_new"), tmp_path / "n.html")
    assert "something new" in text


def test_missing_numbers_are_dashes_not_nan(arm, tmp_path):
    nothing = np.full(2, np.nan)
    estimate = Altered(
        arm, x0=nothing, x0_se=nothing,
        interval=lambda name: (nothing, nothing) if name == "x0" else arm.interval(name),
    )  # fmt: skip
    words = Page(_without_figures(estimate, tmp_path / "d.html")).text
    assert not re.search(r"\bnan\b", words, re.IGNORECASE) and "–" in words


def test_direction_of_a_round_ellipse_is_undefined(arm, tmp_path):
    shapes = dict(arm.ellipses())
    shapes["K"] = Altered(shapes["K"], angle_defined=False)
    text = _without_figures(Altered(arm, ellipses=lambda: shapes), tmp_path / "r.html")
    assert "<td>undefined</td>" in text


def test_one_axis(tmp_path):
    path = ROOT.parent / "shared" / "data" / "ankle" / "ankle-b.csv"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    estimate = ulna.identify_impedance(ulna.read(path), lowpass_hz=50.0, train_s=40.0)
    read = Page(_without_figures(estimate, tmp_path / "ankle.html"))
    assert "N m/rad" in read.text and "kg m²" in read.text and "Ellipses" not in read.text


@pytest.mark.parametrize(
    "value, spread, shown",
    [(41.234, 9.7, "41.2"), (-0.93, 0.1, "−0.93"), (125.43, 13.0, "125"), (-0.001, 2.0, "0.0"),
     (float("nan"), 1.0, "–"), (0.015712, 0.00021, "0.01571")],
)  # fmt: skip
def test_numbers_show_two_figures_of_their_uncertainty(value, spread, shown):
    assert number(value, spread) == shown


def test_number_words():
    assert [digits_after_point(s) for s in (0.1, 0.099, 1.0, 10.0, float("nan"))] == [2, 3, 1, 0, 3]
    assert percent(0.9871) == "99 %" and percent(0.995) == "99.5 %"
    assert percent(1.0) == "above 99.9 %" and percent(0.0) == "below 0.1 %"
    assert percent(float("nan")) == "unknown"
    assert value_and_interval(4.9244, (3.1, 6.75)) == "4.92 [3.10, 6.75]"
    assert value_and_interval(-2.0, None) == "−2"

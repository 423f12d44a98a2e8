"""Saved figures read back: what their axes say of a curve against the numbers that it was drawn from."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from subprocess import Popen
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.image import imread
from pypdf import PageObject, PdfReader

from fingerlab.sessions.model import Array

SVG = "{http://www.w3.org/2000/svg}"
TIME = np.linspace(0.0, 10.0, 101)
FORCE = 2.0 + 1.5 * np.sin(TIME)
INK = 0x1B / 255
"""Of a measured curve on paper."""
DIGIT_EM, CENTRE_EM = 0.636, 0.38
"""Width of a digit of DejaVu Sans, and how far its middle is above the foot, in its size."""
SCALES = ("1", "1.25", "1.5", "2")

DRAW = """
import sys
import numpy as np
import pyqtgraph as pg
from pathlib import Path
from PySide6.QtWidgets import QApplication
from fingerlab.core.text import ScreenUnit
from fingerlab.ui.widgets.plot_figure import save_plot
from fingerlab.ui.widgets.plot_figure import Paper
from fingerlab.ui.widgets.plots import Cursor, QuietPlot
from fingerlab.ui.widgets.theme import apply_appearance

app = QApplication([])
apply_appearance(app, "dark")
plot = QuietPlot("force", "Force over time")
plot.resize(640, 400)
plot.name_axes("Endpoint force", ScreenUnit("N", 1.0), "Time (s)")
time = np.linspace(0.0, 10.0, 101)
item = plot.getPlotItem()
item.addItem(pg.PlotCurveItem(time, 2.0 + 1.5 * np.sin(time), pen=plot.pen("measured")))
item.addItem(Cursor(4.321, angle=90))
plot.setRange(xRange=(0, 10), yRange=(0, 4), padding=0)
plot.show()
app.processEvents()
for ending in ("svg", "pdf", "png"):
    save_plot(plot, Path(sys.argv[1]) / f"force.{ending}")
paper = Paper(640 / 96 * 25.4, 400 / 96 * 25.4, 300, "Force over time")
save_plot(plot, Path(sys.argv[1]) / "fine.png", paper)
"""


@pytest.fixture(scope="module")
def drawing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, tuple[Path, Popen[bytes]]]]:
    """A process for each scale of a screen, all at once, and the folder that it saves in."""
    started = {}
    for scale in SCALES:
        folder = tmp_path_factory.mktemp("saved")
        environment = os.environ | {"QT_SCALE_FACTOR": scale, "QT_QPA_PLATFORM": "offscreen"}
        started[scale] = folder, Popen([sys.executable, "-P", "-c", DRAW, str(folder)], env=environment)
    yield started
    for _, process in started.values():
        process.kill()
        process.wait()


@pytest.fixture(scope="module", params=SCALES)
def saved(request: pytest.FixtureRequest, drawing: dict[str, tuple[Path, Popen[bytes]]]) -> Path:
    """A force of 2 N ± 1.5 N over ten seconds, saved from a dark window on a screen of each scale."""
    folder, process = drawing[request.param]
    assert process.wait(timeout=240) == 0
    return folder


def ticks(tree: ElementTree.Element, axis: str) -> tuple[Array, Array]:
    """Places (points) and values of an axis' ticks, as they are printed."""
    (group,) = [node for node in tree.iter(f"{SVG}g") if node.get("id", "") == axis]
    places, values = [], []
    for tick in (n for n in group if re.fullmatch(r"[xy]tick_\d+", n.get("id", ""))):
        mark = list(tick.iter(f"{SVG}use"))[-1]
        words = "".join(tick.itertext()).strip()
        places.append(float(mark.get("x" if axis.endswith("1") else "y", "nan")))
        values.append(float(words.replace("−", "-")))
    return np.array(places), np.array(values)


def test_ticks_of_the_svg_stand_where_the_curve_has_their_values(saved: Path) -> None:
    tree = ElementTree.parse(saved / "force.svg").getroot()
    (curve,) = [
        node.get("d", "")
        for group in tree.iter(f"{SVG}g")
        if re.fullmatch(r"line2d_\d+", group.get("id", ""))
        for node in group.findall(f"{SVG}path")
        if "stroke: #1b1b1b" in node.get("style", "") and node.get("d", "").count("L") > 20
    ]
    points = np.array(re.findall(r"[ML] (\S+) (\S+)", curve), dtype=float)
    for column, axis in ((0, "matplotlib.axis_1"), (1, "matplotlib.axis_2")):
        places, values = ticks(tree, axis)
        assert len(places) >= 3
        slope, offset = np.polyfit(places, values, 1)
        assert slope * places + offset == pytest.approx(values, abs=1e-3)
        read = slope * points[:, column] + offset
        expected = (TIME, FORCE)[column]
        assert (read.min(), read.max()) == pytest.approx((expected.min(), expected.max()), abs=0.01)
        if column == 0:
            time = read
    assert slope * points[:, 1] + offset == pytest.approx(np.interp(time, TIME, FORCE), abs=0.02)


def test_each_has_labels_legend_and_title_and_no_cursor(saved: Path) -> None:
    words = " ".join(
        "".join(node.itertext()).strip() for node in ElementTree.parse(saved / "force.svg").iter()
    )
    printed = PdfReader(io.BytesIO((saved / "force.pdf").read_bytes())).pages[0].extract_text()
    for text in (words, printed):
        for one in ("Endpoint force (N)", "Time (s)", "Force over time", "measured"):
            assert one in text
    tree = ElementTree.parse(saved / "force.svg").getroot()
    for axis in ("matplotlib.axis_1", "matplotlib.axis_2"):
        for value in ticks(tree, axis)[1]:
            assert re.search(rf"\b{value:g}\b", printed), (value, printed)
    drawn = [node.get("style", "") for node in tree.iter(f"{SVG}path")]
    assert not [style for style in drawn if "#ececec" in style]  # nothing of the dark window
    box = PdfReader(io.BytesIO((saved / "force.pdf").read_bytes())).pages[0].mediabox
    assert (float(box.width), float(box.height)) == pytest.approx((480, 300), abs=0.5)


def words_of_pdf(page: PageObject) -> list[tuple[float, float, float]]:
    """Value and place (points, of the word's middle) of every number that is printed upright."""
    found = []

    def visit(text: str, place: list[float], _: list[float], __: object, size: float) -> None:
        word = text.strip().replace("−", "-")
        if re.fullmatch(r"-?[\d.]+", word) and place[0] == 1.0:
            middle = place[4] + 0.5 * len(word.replace(".", "")) * DIGIT_EM * size
            middle += 0.5 * word.count(".") * 0.318 * size
            found.append((float(word), middle, place[5] + CENTRE_EM * size))

    page.extract_text(visitor_text=visit)
    return found


def test_numbers_of_the_pdf_stand_where_the_curve_has_their_values(saved: Path) -> None:
    page = PdfReader(io.BytesIO((saved / "force.pdf").read_bytes())).pages[0]
    words = np.array(words_of_pdf(page))
    content = page["/Contents"].get_object().get_data().decode("latin-1")
    paths = re.findall(r"((?:[\d.]+ [\d.]+ [ml]\s+){20,})", content)
    points = np.array(re.findall(r"([\d.]+) ([\d.]+) [ml]", max(paths, key=len)), dtype=float)
    below = words[:, 2] < words[:, 2].min() + 1.0
    read = []
    for column, of_axis in ((1, words[below]), (2, words[~below])):
        assert len(of_axis) >= 3
        slope, offset = np.polyfit(of_axis[:, column], of_axis[:, 0], 1)
        assert slope * of_axis[:, column] + offset == pytest.approx(of_axis[:, 0], abs=0.01)
        read.append(slope * points[:, column - 1] + offset)
    assert (read[0].min(), read[0].max()) == pytest.approx((0.0, 10.0), abs=0.02)
    assert read[1] == pytest.approx(np.interp(read[0], TIME, FORCE), abs=0.03)


def middles(dark: Array) -> Array:
    """Of every stretch of dark dots in a row of them."""
    places = np.flatnonzero(dark)
    return np.array([part.mean() for part in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)])


@pytest.mark.parametrize(("name", "dots"), [("force.png", 192), ("fine.png", 300)])
def test_dots_of_the_png_are_where_its_axes_say(saved: Path, name: str, dots: int) -> None:
    """Its ticks are counted off below and beside the axes; their words are those of the SVG."""
    grey = imread(saved / name)[:, :, :3].mean(axis=2)
    assert grey.shape == pytest.approx((400 * dots / 96, 640 * dots / 96), abs=1)
    black = grey < 0.5
    left, foot = int(np.argmax(black.sum(axis=0))), int(np.argmax(black.sum(axis=1)))
    out = round(2.0 * dots / 72)  # in the midst of a tick, 3.5 points long
    tree = ElementTree.parse(saved / "force.svg").getroot()
    scales = []
    for axis, marks in (
        ("matplotlib.axis_1", left - 2 + middles(black[foot + out, left - 2 :])),
        ("matplotlib.axis_2", middles(black[: foot + 3, left - out])[::-1]),
    ):
        values = ticks(tree, axis)[1]
        assert len(marks) == len(values)
        scales.append(np.polyfit(marks, values, 1))
        assert np.polyval(scales[-1], marks) == pytest.approx(values, abs=0.01)
    # In the axes nothing but the curve is dark; a column's dots lie about it.
    inside = black[: foot - out, left + out :]
    inside[: round(np.roots(scales[1] - [0.0, 3.9])[0])] = False
    for moment in (0.5, 1.571, 3.0, 4.712, 6.5, 9.0):
        column = round((moment - scales[0][1]) / scales[0][0])
        drawn = np.polyval(scales[1], np.flatnonzero(inside[:, column - left - out]).mean())
        assert drawn == pytest.approx(2.0 + 1.5 * np.sin(moment), abs=0.02)
    inked = grey[: foot - out, left + out :][inside]
    assert inked.min() == pytest.approx(INK, abs=0.01)  # the light window's, though a dark one was shown

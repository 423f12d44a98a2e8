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
from pypdf import PdfReader

from fingerlab.sessions.model import Array

SVG = "{http://www.w3.org/2000/svg}"
TIME = np.linspace(0.0, 10.0, 101)
FORCE = 2.0 + 1.5 * np.sin(TIME)
SCALES = ("1", "1.25", "1.5", "2")

DRAW = """
import sys
import numpy as np
import pyqtgraph as pg
from pathlib import Path
from PySide6.QtWidgets import QApplication
from fingerlab.core.text import ScreenUnit
from fingerlab.ui.widgets.plot_export import save_plot
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

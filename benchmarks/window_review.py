"""Reviewing a run of ten hours in Sessions: until it is shown, and each frame of panning and zooming."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

from PySide6.QtWidgets import QApplication

from benchmarks.long_session import write_long_session
from benchmarks.machine import Frame, Share, Watch, timed
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.sessions.review_page import ReviewPage
from fingerlab.ui.sessions.sessions_tab import SessionsTab

HOURS = 10.0
OVERS = 4
"""As many further runs as can be laid over the first."""
OVER_HOURS = 2.0
"""Length of each of them."""
FIRST_OVER = 2
"""Row of the first of them among the choices: after "Nothing over it" and the run under review itself."""
VIEWS_S = {"five hours": 5 * 3600.0, "an hour": 3600.0, "a minute": 60.0, "ten seconds": 10.0}
"""Width of the view in which is panned, s."""
PANS = 60
STEP = 0.02
"""Each frame of panning moves the view by this share of its width."""
ZOOMS = 60
ONE_OVER = "with another run over it"
ALL_OVER = "with four runs over it"
ZOOM = "zoom, from ten hours to a second and back"


@dataclass
class Reviewed:
    """Seconds until the review stands, until all is read; frames by what was done."""

    shown: float = 0.0
    read: float = 0.0
    frames: dict[str, list[Frame]] = field(default_factory=dict)
    share: Share | None = None


def review(window: MainWindow, app: QApplication, folder: Path, hours: float = HOURS) -> Reviewed:
    """Open such a session through the tab, pan and zoom."""
    path = folder / "long.h5"
    write_long_session(path, hours, *OVERS * [min(OVER_HOURS, hours)])
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    window.show_tab("sessions")
    app.processEvents()
    watch, found, page = Watch(), Reviewed(), tab.review_page
    started = time.perf_counter()
    tab.review([path])
    while page.session is None or not page.plots.layers:
        app.processEvents()
    app.processEvents()
    found.shown = time.perf_counter() - started
    _settle(app, page)
    found.read = time.perf_counter() - started
    for words, width in VIEWS_S.items():
        found.frames[f"pan, {words} in view"] = _pan(app, page, width)
        watch.look()
    found.frames[ZOOM] = _zoom(app, page)
    watch.look()
    _lay_over(app, page, 1)
    found.frames[f"pan, an hour in view, {ONE_OVER}"] = _pan(app, page, 3600.0)
    found.frames[f"pan, a minute in view, {ONE_OVER}"] = _pan(app, page, 60.0)
    watch.look()
    _lay_over(app, page, OVERS)
    for words in ("five hours", "an hour", "a minute"):
        found.frames[f"pan, {words} in view, {ALL_OVER}"] = _pan(app, page, VIEWS_S[words])
        watch.look()
    found.frames[f"{ZOOM}, {ALL_OVER}"] = _zoom(app, page)
    found.share = watch.share()
    return found


def _lay_over(app: QApplication, page: ReviewPage, runs: int) -> None:
    """Lay the first of the further runs over, until there are so many, and wait until all is read."""
    for row in range(FIRST_OVER, FIRST_OVER + runs):
        page.over.setCurrentIndex(row)
        _settle(app, page)
    if len(page.plots.layers) != 1 + runs:
        raise RuntimeError(f"{len(page.plots.layers) - 1} runs lie over the run under review, not {runs}.")


def _frame(
    app: QApplication, page: ReviewPage, left: float, right: float, into: list[Frame] | None = None
) -> None:
    """One frame with all that belongs to it: the curves are fed at once, not a moment later."""
    with timed(into if into is not None else []):
        page.plots.top.setXRange(left, right, padding=0)
        page.plots.feed()
        app.processEvents()


def _settle(app: QApplication, page: ReviewPage) -> None:
    """Until nothing is read any more."""
    end = time.perf_counter() + 0.1
    while page.data.busy or time.perf_counter() < end:
        app.processEvents()
        time.sleep(0.005)
    app.processEvents()


def _pan(app: QApplication, page: ReviewPage, width: float) -> list[Frame]:
    left, span = page.plots.span
    left += min(600.0, 0.02 * (span - left))
    _frame(app, page, left, left + width)
    _settle(app, page)
    times: list[Frame] = []
    for number in range(PANS):
        left += STEP * width * (1 if number < PANS // 2 else -1)
        _frame(app, page, left, left + width, times)
    _settle(app, page)
    return times


def _zoom(app: QApplication, page: ReviewPage) -> list[Frame]:
    first, last = page.plots.span
    middle = (first + last) / 2
    times: list[Frame] = []
    widths = [(last - first) ** (1 - k / ZOOMS) for k in range(ZOOMS + 1)]
    for width in (*widths, *reversed(widths)):
        _frame(app, page, middle - width / 2, middle + width / 2, times)
    _settle(app, page)
    return times

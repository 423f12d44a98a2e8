"""What one waits for: a comparison, an added effect and a refit in the Model lab, a folder in Sessions."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from PySide6.QtWidgets import QApplication

from benchmarks.machine import Share, Watch
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import PROTOCOLS, load_preset
from fingerlab.twin.session import write_session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.model_lab_tab import ModelLabTab
from fingerlab.ui.sessions.sessions_tab import SessionsTab

FOLDERS = (120, 2000)
"""Sessions in a folder."""


@dataclass
class Worked:
    """Seconds from a click to what it asks for, by what it is, the same of this process' processor beside."""

    steps: dict[str, tuple[float, float]] = field(default_factory=dict)
    share: Share | None = None

    def take(
        self, words: str, app: QApplication, click: Callable[[], object], there: Callable[[], bool]
    ) -> None:
        """Click, and let the window work until it is there and painted."""
        wall, processor = time.perf_counter(), time.process_time()
        click()
        app.processEvents()
        while not there():
            app.processEvents()
        app.processEvents()
        self.steps[words] = time.perf_counter() - wall, time.process_time() - processor


def work(window: MainWindow, app: QApplication, folder: Path) -> Worked:
    """A session of the rich protocol with Coulomb friction, then folders of such sessions."""
    found, watch = Worked(), Watch()
    path = folder / "finger-rig.h5"
    preset = load_preset()
    press = preset.numbers["protocol"]["contact_amplitude_deg"]
    write_session(path, preset, "rich", PROTOCOLS["rich"](press), parse_effects(("coulomb_friction",)), 11)
    tab = window.tab("model_lab")
    assert isinstance(tab, ModelLabTab)
    window.show_tab("model_lab")
    lab = tab.controller

    def idle() -> bool:
        return not window.tasks.busy

    found.take(
        "a session opened, until measured and modelled are drawn and the verdict stands",
        app, lambda: window.open_paths([path]), lambda: lab.diagnosis is not None and idle(),
    )  # fmt: skip
    watch.look()
    nominal = lab.diagnosis
    found.take(
        "an effect added, until its curves and the next verdict stand",
        app, tab.view.candidates.add_button.click, lambda: lab.diagnosis is not nominal and idle(),
    )  # fmt: skip
    watch.look()
    parameters, added = tab.view.parameters, lab.diagnosis
    found.take(
        "the table of parameters",
        app,
        tab.view.numbers.click,
        lambda: parameters.table.rowCount() > 0 and idle(),
    )
    parameters.hold.click()
    found.take(
        "a refit with one of them held",
        app, parameters.refit.click, lambda: lab.diagnosis is not added and idle(),
    )  # fmt: skip
    watch.look()
    _browse(found, window, app, path, folder)
    watch.look()
    found.share = watch.share()
    return found


def _browse(found: Worked, window: MainWindow, app: QApplication, session: Path, folder: Path) -> None:
    sessions = window.tab("sessions")
    assert isinstance(sessions, SessionsTab)
    window.show_tab("sessions")
    short = folder / "short.h5"
    preset = load_preset()
    write_session(short, preset, "one", PROTOCOLS["thesis"](2.0)[:1], {}, 1)
    model = sessions.page.model
    for count in FOLDERS:
        place = folder / f"{count}"
        place.mkdir()
        for number in range(count):
            shutil.copyfile(short, place / f"day-{number:04d}.h5")
        found.take(
            f"a folder of {count:,} sessions, until its first rows stand",
            app, lambda p=place: sessions.browse(p), lambda n=count: 0 < model.total <= n,
        )  # fmt: skip
        found.take(
            f"from there until all of the {count:,} are read",
            app, lambda: None, lambda n=count: model.total == n and not sessions._scanner.busy,
        )  # fmt: skip
        found.take(
            f"the {count:,} again, known from before",
            app, sessions.read_again, lambda n=count: model.total == n and not sessions._scanner.busy,
        )  # fmt: skip

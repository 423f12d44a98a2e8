"""The program's end: a process of its own that used the plots leaves without a word and with 0."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

SCRIPT = """
import faulthandler, sys
from pathlib import Path
from PySide6.QtCore import QSettings, QTimer
from PySide6.QtWidgets import QApplication
from shiboken6 import isValid
from fingerlab.ui.app import application
from fingerlab.ui.app.context import Settings
from fingerlab.ui.app.window import MainWindow

faulthandler.enable()
folder = Path(sys.argv[1])


class Driven(MainWindow):
    "Uses Sessions and is closed; one step at each tick of a timer."

    def __init__(self, settings):
        super().__init__(settings)
        self.steps = self.use(self.tab("sessions"))
        self.timer = QTimer(self)
        self.timer.timeout.connect(lambda: next(self.steps, None))  # ticks once more while it closes
        self.timer.start(20)

    def use(self, tab):
        while not tab.page.model.total:
            yield
        tab.page.choose_path(next(folder.glob("*.h5")))
        tab.page.details.review.click()
        while tab.review_page.session is None or tab.data.busy:
            yield
        tab.review_page.over.setCurrentIndex(2)
        tab.review_page.cursors.click()
        while tab.data.busy:
            yield
        tab.review_page.strokes.click()
        while tab.review_page.plots.cycles is None:
            yield
        kept.append(self)
        self.close()
        yield


kept = []  # as a circle of references would
app = QApplication([])  # and this lives until Python clears up
application.MainWindow = Driven
settings = Settings(QSettings(str(folder / "settings.ini"), QSettings.Format.IniFormat))
settings.set_tab("sessions")
settings.set_library(folder)
code = application.run([], settings)
assert not isValid(kept[0]), "the window outlives its application"
sys.exit(code)
"""


def test_a_process_that_used_sessions_ends_well(make_session: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "library").mkdir()
    make_session("library/ring.h5", phases=(("on_air", "extension"),) * 2)
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path / "library")],
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")

"""Makes the pictures in ``docs/images`` from the running program.

Records a session from the simulated rig, opens it in the real window and saves what
the window shows, light and dark::

    python docs/screenshots.py            # into docs/images
    python docs/screenshots.py FOLDER     # elsewhere, to look first

Runs without a display (Qt's off-screen platform).
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QEventLoop, QSettings, QTimer
from PySide6.QtWidgets import QApplication

from fingerlab.twin.effects import parse_effects
from fingerlab.twin.preset import load_preset
from fingerlab.twin.protocols import PROTOCOLS
from fingerlab.twin.session import write_session
from fingerlab.ui import application
from fingerlab.ui.settings import Settings
from fingerlab.ui.theme import apply_appearance
from fingerlab.ui.window import MainWindow

EFFECT = "coulomb_friction"
SEED = 11
SIZE = (1280, 800)


def main() -> None:
    """Make all pictures."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "images"
    target.mkdir(parents=True, exist_ok=True)
    app = QApplication([])
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(QSettings(f"{folder}/settings.ini", QSettings.Format.IniFormat))
        application.prepare(app, settings)
        window = MainWindow(settings)
        window.resize(*SIZE)
        window.show()
        window.show_tab("model_lab")
        window.open_paths([record(Path(folder) / "finger-rig.h5")])
        wait(window)
        for name, appearance in (("model-lab", "light"), ("model-lab-dark", "dark")):
            apply_appearance(app, appearance)  # type: ignore[arg-type]
            pause(200)
            window.grab().save(str(target / f"{name}.png"))
        window.close()


def record(path: Path) -> Path:
    """A session of the simulated rig with one effect that the nominal model lacks."""
    preset = load_preset()
    plans = PROTOCOLS["rich"](preset.numbers["protocol"]["contact_amplitude_deg"])
    write_session(path, preset, "rich", plans, parse_effects((EFFECT,)), SEED)
    return path


def wait(window: MainWindow) -> None:
    """Until nothing runs any more."""
    pause(50)
    while window.tasks.busy:
        pause(20)
    pause(300)


def pause(milliseconds: int) -> None:
    """Let the window work. (QTest.qWait would keep Python's lock and starve the worker.)"""
    loop = QEventLoop()
    QTimer.singleShot(milliseconds, loop.quit)
    loop.exec()


if __name__ == "__main__":
    main()

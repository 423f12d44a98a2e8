"""Makes the pictures in ``docs/images`` from the running program.

Every tab in every state that matters, light and dark, at 1280 x 800 and 1920 x 1080. The rig is the simulated
one on a virtual clock; the Model lab shows a session that is recorded from it first::

    python docs/screenshots.py            # into docs/images
    python docs/screenshots.py FOLDER     # elsewhere, to look first
    python docs/screenshots.py FOLDER acquire   # only one tab

Runs without a display (Qt's off-screen platform).
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from click.testing import CliRunner
from PySide6.QtCore import QEventLoop, QSettings, QTimer
from PySide6.QtWidgets import QApplication

from fingerlab.acquisition.inline import InlineBench
from fingerlab.acquisition.requests import LoopSettings
from fingerlab.acquisition.safety import Limits
from fingerlab.acquisition.units import BenchUnits
from fingerlab.calibration import StepTiming
from fingerlab.cli.main import cli
from fingerlab.devices.simulated import SimulatedRig, Simulation
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.preset import load_preset
from fingerlab.twin.protocols import PROTOCOLS
from fingerlab.twin.session import write_session
from fingerlab.ui import application
from fingerlab.ui.acquire import tab as acquire
from fingerlab.ui.acquire.opening import OpenBench, Wanted
from fingerlab.ui.browse.tab import SessionsTab
from fingerlab.ui.calibrate.tab import CalibrateTab
from fingerlab.ui.desk import RigLine
from fingerlab.ui.fitting.tab import FitTab
from fingerlab.ui.predicting.tab import PredictTab
from fingerlab.ui.settings import Settings
from fingerlab.ui.theme import apply_appearance
from fingerlab.ui.window import MainWindow

EFFECT = "coulomb_friction"
SEED = 11
SIZES = ((1280, 800), (1920, 1080))
LOOKS = ("light", "dark")

States = Callable[[MainWindow, Path], Iterator[str]]


def main() -> None:
    """Make all pictures, or those of the tabs that are named."""
    words = sys.argv[1:]
    target = Path(words[0]) if words else Path(__file__).parent / "images"
    target.mkdir(parents=True, exist_ok=True)
    wanted = words[1:] or list(TABS)
    app = QApplication([])
    with tempfile.TemporaryDirectory() as folder:
        for name in wanted:
            take(app, name, TABS[name], target, Path(folder))


def take(app: QApplication, tab: str, states: States, target: Path, folder: Path) -> None:
    """All states of one tab: in each, light and dark in every size."""
    settings = Settings(QSettings(f"{folder}/{tab}.ini", QSettings.Format.IniFormat))
    settings.set_recordings(folder / "recordings")
    settings.set_tab(tab)
    application.prepare(app, settings)
    window = MainWindow(settings)
    window.resize(*SIZES[0])
    window.show()
    for state in states(window, folder):
        for look in LOOKS:
            apply_appearance(app, look)  # type: ignore[arg-type]
            for size in SIZES:
                window.resize(*size)
                pause(150)
                dark, wide = ["dark"] if look == "dark" else [], [str(size[0])] if size != SIZES[0] else []
                name = "-".join([tab.replace("_", "-"), *([state] if state else []), *dark, *wide])
                window.grab().save(str(target / f"{name}.png"))
        window.resize(*SIZES[0])
    window.close()


def acquire_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """Connecting, running with the model, cursors, stopped, a protocol's prompt."""
    acquire.ask_to_close = lambda *_: True  # type: ignore[assignment]
    tab = window.tab("acquire")
    assert isinstance(tab, acquire.AcquireTab)
    tab.station._opener = lambda wanted: on_virtual_clock(wanted, folder)
    wait_until(lambda: not tab.station.caller.busy)
    yield "connect"
    tab.station.open(Wanted("simulated", effect=EFFECT))
    wait_until(lambda: tab.station.bench is not None)
    tab.station._timer.stop()

    def run(seconds: float) -> None:
        for _ in range(round(seconds / 0.033)):
            tab.station.tick()

    run(1.0)
    for button in (tab.panel.initialise, tab.panel.enable, tab.panel.start, tab.panel.record):
        button.click()
        run(0.2)
    tab.toolbar.model_chosen.emit("nominal")
    run(11.0)
    tab.panel.note.setText("a light touch")
    tab.panel.mark.click()
    run(1.5)
    yield "running"
    tab.toolbar.hold.click()
    tab.toolbar.cursors.click()
    yield "cursors"
    tab.toolbar.cursors.click()
    tab.toolbar.hold.click()
    tab.station.stop()
    run(0.2)
    pause(500)
    run(0.2)
    yield "stopped"
    tab.panel.release.click()
    tab.panel.write.click()
    wait_until(lambda: not tab.station.caller.busy)
    window.desk.hush()
    tab.toolbar.model_chosen.emit("none")
    tab.panel.by_protocol.click()
    tab.panel.run.click()
    wait_until(tab.prompt.isVisible)
    tab.plots.tick()
    yield "prompt"
    tab.station.stop()


def calibrate_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """Without a rig; a step of the load cell, a wrong weight, the result; a hand at the simulated rig."""
    tab = window.tab("calibrate")
    assert isinstance(tab, CalibrateTab)
    tab._folder = Path("calibrations")
    tab.on_shown()
    yield "start"
    opened = replace(on_virtual_clock(Wanted("simulated"), folder), calibrations=folder / "calibrations")
    bench, wrong = opened.bench, {5: 0.7}
    assert isinstance(bench, InlineBench)
    window.desk.show_bench(opened)
    window.desk.show_rig(RigLine(light="ready", state="initialised", device="simulated rig"))
    tab.start("load-cell")
    wizard = tab.wizard
    assert wizard is not None

    def work(steps: int, seconds: float = 0.0) -> None:
        end = None
        while end is None or bench.status().index < end:
            if wizard.move is not None:
                mass = wrong.get(wizard.number, wizard.move.mark)
                bench.device.bench.move_by_hand("load_cell", 9.81 * mass)  # type: ignore[attr-defined]
            bench.step(100)
            tab.source.tick()
            if end is None and wizard.number >= steps:
                end = bench.status().index + round(1000 * seconds)

    work(3, 9.0)
    yield "hold"
    wizard.timing = StepTiming(3.0, 1.0)
    work(6, 0.5)
    yield "doubt"
    wrong.clear()
    tab.undo()
    work(len(wizard.plan.moves))
    yield "result"
    tab._end()
    window.desk.show_bench(None)
    bench.close()


def lab_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """Nothing open; then a session with one effect."""
    yield "empty"
    window.open_paths([record(folder / "finger-rig.h5")])
    pause(50)
    wait_until(lambda: not window.tasks.busy)
    pause(300)
    yield ""


def sessions_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """A folder with a session; one of its runs with cursors and another run over it; its strokes."""
    library = folder / "library"
    library.mkdir()
    record(library / "finger-rig.h5")
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.browse(library)
    wait_until(lambda: tab.page.model.total > 0)
    tab.page.choose_path(library / "finger-rig.h5")
    pause(500)
    yield ""
    tab.page.details.review.click()
    wait_until(lambda: tab.review_page.session is not None and not tab.data.busy)
    tab.review_page.over.setCurrentIndex(2)
    tab.review_page.cursors.click()
    pause(500)
    wait_until(lambda: not tab.data.busy)
    yield "review"
    tab.review_page.strokes.click()
    wait_until(lambda: tab.review_page.plots.cycles is not None)
    yield "strokes"
    tab.show_table()


def fit_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """The runs on air of a session, fitted."""
    yield "empty"
    window.desk.open_paths([record(folder / "finger-rig.h5")], tab="fit")
    tab = window.tab("fit")
    assert isinstance(tab, FitTab)
    wait_until(lambda: not window.tasks.busy and bool(tab.sessions))
    tab.analyse()
    wait_until(lambda: tab.found is not None)
    pause(300)
    yield ""


def predict_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """The contact runs of a session, by the parameters fitted on air and by a model with the effect."""
    yield "empty"
    session = record(folder / "in-contact.h5")
    models = [folder / "on-air.json", folder / "with-effect.json"]
    for words in (["fit", str(session), "--model"], ["diagnose", str(session), "--add", EFFECT, "--save"]):
        done = CliRunner().invoke(cli, [*words, str(models[len(words) > 3])])
        assert done.exit_code == 0, done.output
    window.desk.open_paths([session], tab="predict")
    tab = window.tab("predict")
    assert isinstance(tab, PredictTab)
    wait_until(lambda: not window.tasks.busy and bool(tab.sessions))
    tab.add_files(models)
    wait_until(lambda: tab.found is not None)
    pause(300)
    yield ""


TABS: dict[str, States] = {
    "acquire": acquire_states,
    "calibrate": calibrate_states,
    "sessions": sessions_states,
    "fit": fit_states,
    "predict": predict_states,
    "model_lab": lab_states,
}


def on_virtual_clock(wanted: Wanted, folder: Path) -> OpenBench:
    """The simulated rig, turned by hand."""
    effects = parse_effects((wanted.effect,) if wanted.effect else ())
    device = SimulatedRig(simulation=Simulation(seed=wanted.seed, effects=effects))
    settings = LoopSettings(BenchUnits.from_rig(device.rig), Limits.from_rig(device.rig))
    bench = InlineBench(device, settings, folder / "rescued")
    return OpenBench(bench, device.rig, dict(device.session_attributes))


def record(path: Path) -> Path:
    """A session of the simulated rig with one effect that the nominal model lacks."""
    preset = load_preset()
    plans = PROTOCOLS["rich"](preset.numbers["protocol"]["contact_amplitude_deg"])
    write_session(path, preset, "rich", plans, parse_effects((EFFECT,)), SEED)
    return path


def wait_until(condition: Callable[[], bool]) -> None:
    """Let the window work until something is so."""
    while not condition():
        pause(20)


def pause(milliseconds: int) -> None:
    """Let the window work. (QTest.qWait would keep Python's lock and starve the worker.)"""
    loop = QEventLoop()
    QTimer.singleShot(milliseconds, loop.quit)
    loop.exec()


if __name__ == "__main__":
    main()

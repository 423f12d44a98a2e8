"""The states of each tab that ``screenshots.py`` takes pictures of: what a person does to get there."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
from click.testing import CliRunner
from PySide6.QtCore import QEventLoop, QItemSelectionModel, Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QTableView, QWidget

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.calibration import StepTiming
from fingerlab.cli.main import cli
from fingerlab.core.text import estimate_text, score_text
from fingerlab.devices.simulated import SimulatedRig, Simulation
from fingerlab.effects.own import template
from fingerlab.report import diagnosis_words as words
from fingerlab.sessions import open_session
from fingerlab.sessions.mapping import BENCH_ORDER
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import PROTOCOLS, RunPlan, load_preset
from fingerlab.twin.session import write_session
from fingerlab.ui.acquire import acquire_tab as acquire
from fingerlab.ui.acquire.bench_setup import BenchRequest, OpenBench
from fingerlab.ui.app.context import RigLine
from fingerlab.ui.app.documents import Documents
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.calibrate.calibrate_tab import CalibrateTab
from fingerlab.ui.calibrate.result_page import ResultPage
from fingerlab.ui.fit.fit_tab import FitTab
from fingerlab.ui.fit.fit_view import ReplicateDialog
from fingerlab.ui.lab.budget import BudgetDialog
from fingerlab.ui.lab.model_dialogs import SideBySideDialog
from fingerlab.ui.lab.model_lab_tab import ModelLabTab
from fingerlab.ui.lab.own_effects import OwnEffects
from fingerlab.ui.predict.force_panel import ModelsDialog
from fingerlab.ui.predict.predict_tab import PredictTab
from fingerlab.ui.sessions.import_dialog import ImportDialog
from fingerlab.ui.sessions.sessions_tab import SessionsTab

EFFECT = "coulomb_friction"
SEED = 11
HIDDEN_SEED = 7
FACTS: dict[str, str] = {}
"""What the window said, by ``tab.name``, filled while the pictures are taken."""

States = Callable[[MainWindow, Path], Iterator[str]]


def acquire_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """Connecting, running with the model, cursors, stopped, a protocol's prompt."""
    acquire.ask_to_close = lambda *_: True  # type: ignore[assignment]
    tab = window.tab("acquire")
    assert isinstance(tab, acquire.AcquireTab)
    tab.controller._opener = lambda wanted: on_virtual_clock(wanted, folder)
    wait_until(lambda: not tab.controller.worker.busy)
    yield "connect"
    tab.controller.open(BenchRequest("simulated", effect=EFFECT))
    wait_until(lambda: tab.controller.bench is not None)
    tab.controller._timer.stop()

    def run(seconds: float) -> None:
        for _ in range(round(seconds / 0.033)):
            tab.controller.tick()

    run(1.0)
    for button in (tab.panel.initialise, tab.panel.enable, tab.panel.start, tab.panel.record):
        button.click()
        run(0.2)
    tab.toolbar.model_chosen.emit("nominal")
    run(11.0)
    tab.panel.note.setText("a light touch")
    tab.panel.mark.click()
    run(1.5)
    FACTS["acquire.error"] = next(
        label.text().removeprefix("error ")
        for label in tab.widget.findChildren(QLabel)
        if label.text().startswith("error ")
    )
    yield "running"
    tab.toolbar.hold.click()
    tab.toolbar.cursors.click()
    yield "cursors"
    tab.toolbar.cursors.click()
    tab.toolbar.hold.click()
    tab.controller.stop()
    run(0.2)
    pause(500)
    run(0.2)
    yield "stopped"
    tab.panel.release.click()
    tab.panel.write.click()
    wait_until(lambda: not tab.controller.worker.busy)
    window.context.hush()
    tab.toolbar.model_chosen.emit("none")
    tab.panel.by_protocol.click()
    protocol = tab.panel.protocol
    protocol.which.setCurrentIndex(protocol.which.findData("own_scan"))
    protocol.scans["amplitude_deg"].setText("5 10 15")
    tab.panel.run.click()
    wait_until(tab.prompt.isVisible)
    tab.plots.tick()
    yield "prompt"
    tab.controller.stop()
    wait_until(lambda: not tab.recording.in_protocol)
    pause(300)
    window.context.hush()
    protocol.which.setCurrentIndex(protocol.which.findData("force_trial"))
    yield "force-trial"


def calibrate_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """Without a rig; a step of the load cell, a wrong weight, the result; a hand at the simulated rig."""
    tab = window.tab("calibrate")
    assert isinstance(tab, CalibrateTab)
    tab._folder = Path("my-rig-calibrations")
    tab.on_shown()
    yield "start"
    opened = replace(
        on_virtual_clock(BenchRequest("simulated"), folder), calibrations=folder / "calibrations"
    )
    bench, wrong = opened.bench, {5: 0.7}
    assert isinstance(bench, InlineBench)
    window.context.show_bench(opened)

    def tell_rig() -> None:
        samples = bench.status().index
        window.context.show_rig(
            RigLine(light="ready", state="initialised", device="simulated rig", samples=samples)
        )

    tell_rig()
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
    tell_rig()
    yield "hold"
    wizard.timing = StepTiming(3.0, 1.0)
    work(6, 0.5)
    tell_rig()
    yield "doubt"
    wrong.clear()
    tab.undo()
    work(len(wizard.plan.moves))
    read_numbers(tab.widget)
    tell_rig()
    yield "result"
    tab._end()
    window.context.show_bench(None)
    bench.close()


def lab_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """Nothing open; a session with one effect: what is missing, where, after it is added; a value moved.

    Besides: a run's spectrum, the budget of the error and a figure to be saved.
    """
    yield "empty"
    tab = opened_in_lab(window, record(folder / "finger-rig.h5"))
    tell_diagnosis("model_lab", tab)
    yield ""
    tab.view.go_to("where")
    tab.view.where.choose_worst()
    pause(300)
    FACTS["model_lab.worst"] = tab.view.where.words.text()
    yield "where"
    over = tab.widget.findChild(QComboBox, "whereCoordinate")
    assert over is not None
    QTest.keyClick(over, Qt.Key.Key_End)
    pause(300)
    yield "spectrum"
    QTest.keyClick(over, Qt.Key.Key_Home)
    tab.view.show_budget()
    (budget,) = window.findChildren(BudgetDialog)
    yield "budget"
    budget.close()
    tab.view.go_to("add")
    add_best(window, tab)
    tell_diagnosis("model_lab.added", tab)
    tell_truth("model_lab.added", tab)
    yield "added"
    window.plots.ask_and_save(tab.view.plot)
    assert window.plots.dialog is not None
    yield "figure"
    window.plots.dialog.close()
    tab.view.show_side_by_side()
    (beside,) = window.findChildren(SideBySideDialog)
    wait_until(lambda: not window.tasks.busy)
    pause(300)
    yield "side-by-side"
    beside.close()
    tab.view.numbers.click()
    wait_until(lambda: not window.tasks.busy and tab.view.parameters.table.rowCount() > 0)
    tab.view.parameters.slider.setValue(tab.view.parameters.slider.value() + 60)
    yield "parameters"


def practice_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """A session with a sealed effect, as the button makes it; the best candidate added; revealed."""
    asked = ["simulate", "--protocol", "rich", "--hidden", "--seed", str(HIDDEN_SEED), "--out"]
    done = CliRunner().invoke(cli, [*asked, str(folder / "practice.h5")])
    assert done.exit_code == 0, done.output
    tab = opened_in_lab(window, folder / "practice.h5")
    tell_diagnosis("practice", tab)
    yield "sealed"
    add_best(window, tab)
    tell_diagnosis("practice.added", tab)
    tab.view.go_to("true")
    tab.reveal()
    pause(300)
    yield "revealed"


def opened_in_lab(window: MainWindow, path: Path) -> ModelLabTab:
    """The Model lab with a session compared."""
    window.open_paths([path])
    pause(50)
    wait_until(lambda: not window.tasks.busy)
    pause(300)
    tab = window.tab("model_lab")
    assert isinstance(tab, ModelLabTab)
    return tab


def add_best(window: MainWindow, tab: ModelLabTab) -> None:
    """Press "Add to model" and wait for the new fit."""
    tab.view.candidates.add_button.click()
    pause(50)
    wait_until(lambda: not window.tasks.busy)
    pause(300)


def tell_diagnosis(name: str, tab: ModelLabTab) -> None:
    """The numbers of the present comparison, as the tab words them."""
    diagnosis = tab.controller.diagnosis
    assert diagnosis is not None
    best = words.shown_best_first(diagnosis)[0]
    second = max((c for c in diagnosis.candidates if c is not best), key=lambda c: c.probability)
    FACTS[f"{name}.score"] = score_text(diagnosis.score)
    FACTS[f"{name}.best"] = best.title
    FACTS[f"{name}.best_score"] = score_text(best.score)
    FACTS[f"{name}.second"], FACTS[f"{name}.second_score"] = second.title, score_text(second.score)
    if diagnosis.failure is not None:
        FACTS[f"{name}.where"] = diagnosis.failure.moment
    for key, value in best.parameters.items():
        FACTS[f"{name}.best.{key}"] = estimate_text(value)


def tell_truth(name: str, tab: ModelLabTab) -> None:
    """What "True?" says of the runs in contact: nominal error and the present one."""
    table = tab.view.validation.runs
    rows = [[table.item(row, column).text() for column in range(3)] for row in range(table.rowCount())]
    _, nominal, now = next(row for row in rows if "in contact" in row[0])
    FACTS[f"{name}.contact_nominal"], FACTS[f"{name}.contact_now"] = nominal, now
    found = re.search(r"endpoint force on them goes from (.+?) \(", tab.view.validation.held_out.text())
    assert found is not None
    FACTS[f"{name}.force"] = found[1]


def sessions_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """A folder with sessions; one of its runs with cursors and two other runs over it; its strokes.

    Then a bench over days: all diagnosed, the trend, two days run by run.
    """
    library = Path("recordings")
    library.mkdir(exist_ok=True)
    record(library / "finger-rig.h5")
    others = (("on-air", "2", "new-cable", []), ("motor-bench", "4", "motor", []),
              ("on-air", "3", "old-grease", ["--effect", "viscous_friction"]))  # fmt: skip
    for protocol, seed, name, effect in others:
        place = ["--seed", seed, "--out", f"recordings/{name}.h5"]
        asked = ["simulate", "--protocol", protocol, *effect, *place]
        done = CliRunner().invoke(cli, asked)
        assert done.exit_code == 0, done.output
    done = CliRunner().invoke(cli, ["batch", "recordings", "--out", "recordings/verdicts.parquet"])
    assert done.exit_code == 0, done.output
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.browse(library)
    wait_until(lambda: tab.page.model.total == len(list(library.glob("*.h5"))))
    tab.page.choose_path(library / "finger-rig.h5")
    pause(3000)  # the thumbnails are drawn in the background
    yield ""
    tab.page.details.review.click()
    wait_until(lambda: tab.review_page.session is not None and not tab.data.busy)
    for row in (2, 3):
        tab.review_page.over.setCurrentIndex(row)
    tab.review_page.cursors.click()
    pause(500)
    wait_until(lambda: not tab.data.busy)
    yield "review"
    tab.review_page.over.setCurrentIndex(0)
    tab.review_page.strokes.click()
    wait_until(lambda: tab.review_page.plots.cycles is not None)
    yield "strokes"
    tab.show_table()
    days = bench_over_days(Path("days"))
    tab.browse(days)
    wait_until(lambda: tab.page.model.total == DAYS and not tab.data.busy)
    tab.page.diagnose.click()
    wait_until(lambda: not tab.batch.busy)
    pause(1000)
    yield "diagnosed"
    tab.page.trend.click()
    pause(300)
    assert tab._trend is not None
    FACTS["sessions.change"] = tab._trend.words.text()
    yield "trend"
    benches = tab._trend.benches
    tab._trend.pages.setCurrentWidget(benches)
    benches.first.setCurrentText("day-[1-4].h5")
    benches.second.setCurrentText("day-[5-8].h5")
    benches.compare()
    FACTS["sessions.shared"] = benches.words.text()
    yield "benches"
    tab._trend.close()
    for name in ("day-4.h5", "day-5.h5"):
        index = tab.page.model.index(tab.page.model.row(days / name), 0)
        flags = QItemSelectionModel.SelectionFlag
        tab.page.table.selectionModel().select(index, flags.Select | flags.Rows)
    tab.page.details.compare.click()
    wait_until(lambda: tab._pairs is not None and not window.tasks.busy)
    pause(300)
    assert tab._pairs is not None
    FACTS["sessions.pairs"] = tab._pairs.words.text()
    yield "pairs"
    tab._pairs.close()


DAYS, FIRST_WITH_FRICTION = 8, 5
"""Sessions of a bench on days three apart, and the one from which on a joint rubs."""


def bench_over_days(folder: Path) -> Path:
    """Short sessions of one simulated bench, in the middle of which friction comes."""
    folder.mkdir()
    preset = load_preset("practice")
    waves = [("extension", 15.0, 22.0, f) for f in (1.0, 1.0, 0.5)] + [("flexion", 9.0, 15.0, 1.0)] * 2
    plans = [
        RunPlan(
            "on_air",
            cable,
            {"kind": "sine", "amplitude_deg": a, "offset_deg": o, "frequency_hz": f, "duration_s": 10.0},
        )
        for cable, a, o, f in waves
    ]
    for day in range(1, DAYS + 1):
        path = folder / f"day-{day}.h5"
        effects = parse_effects((EFFECT,) if day >= FIRST_WITH_FRICTION else ())
        write_session(path, preset, "short", plans, effects, SEED)
        noise = np.random.default_rng(day)  # the same bench, another day
        with h5py.File(path, "r+") as file:
            file.attrs["created"] = f"2026-05-{3 * day - 2:02d}T10:00:00+02:00"
            for run in file["runs"].values():
                for channel, spread in (("motor_torque", 2e-4), ("mcp_angle", 2e-5)):
                    run[channel][...] += noise.normal(0.0, spread, len(run[channel]))
    return folder


def fit_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """The runs on air of a session, fitted."""
    yield "empty"
    window.context.open_paths([record(folder / "finger-rig.h5")], tab="fit")
    tab = window.tab("fit")
    assert isinstance(tab, FitTab)
    wait_until(lambda: not window.tasks.busy and bool(tab.sessions))
    tab.analyse()
    wait_until(lambda: tab.found is not None)
    pause(300)
    read_table(tab.widget, "fit", (4, 5, 6, 7, 14))
    yield ""
    tab.show_replicate()
    (again,) = window.findChildren(ReplicateDialog)
    again.run.click()
    wait_until(lambda: again.table.rowCount() > 0 and not again._worker.busy)
    yield "replicate"
    again.close()


def predict_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """The contact runs of a session, by the parameters fitted on air and by a model with the effect.

    Then the other way round: the torque that a wanted force needs.
    """
    yield "empty"
    session = record(folder / "in-contact.h5")
    models = [folder / "on-air.json", folder / "with-effect.json"]
    for asked in (["fit", str(session), "--model"], ["diagnose", str(session), "--add", EFFECT, "--save"]):
        done = CliRunner().invoke(cli, [*asked, str(models[len(asked) > 3])])
        assert done.exit_code == 0, done.output
    window.context.open_paths([session], tab="predict")
    tab = window.tab("predict")
    assert isinstance(tab, PredictTab)
    wait_until(lambda: not window.tasks.busy and bool(tab.sessions))
    tab.add_files(models)
    wait_until(lambda: tab.found is not None)
    pause(300)
    read_table(tab.widget, "predict", range(3))
    yield ""
    tab.force.toggle_cursors()
    pause(100)
    yield "cursors"
    tab.force.toggle_cursors()
    tab.compare()
    wait_until(lambda: bool(window.findChildren(ModelsDialog)) and not window.tasks.busy)
    (compared,) = window.findChildren(ModelsDialog)
    yield "compared"
    compared.close()
    wanted = tab.wanted
    tab.views.choose("wanted")
    wanted.panel.model.setCurrentText("with-effect.json: nominal model + Coulomb joint friction")
    wanted.panel.wanted.numbers["mean_n"].setValue(0.8)
    wanted.panel.wanted.numbers["amplitude_n"].setValue(0.3)
    pause(500)  # the torque is asked for a moment after the last edit
    wait_until(lambda: wanted.plan is not None and not window.tasks.busy)
    FACTS["predict.wanted.model"] = wanted.panel.model.currentText()
    FACTS["predict.wanted.torque"] = wanted.panel.result.text()
    yield "wanted"


def help_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """The documents at the theory's equations, a word of the glossary, an effect of one's own to edit."""
    window.show_documents("theory.md")
    (pages,) = window.findChildren(Documents)
    pages.view.verticalScrollBar().setValue(520)
    yield "documents"
    window.show_documents("glossary.md", "floor")
    yield "glossary"
    pages.close()
    os.environ["FINGERLAB_SETTINGS_DIR"] = str(folder / "own")
    own = OwnEffects(window, "own-effects")
    path = folder / "own" / "seal_friction.py"
    path.parent.mkdir(exist_ok=True)
    own.show()
    own._open(path, template(path, "pip_torque", "PIP torque, run 3: while extending slowly."))
    yield "own-effect"
    own.close()


def import_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """A text file of the simulated rig with decimal commas, as it is looked at before it is imported."""
    session = open_session(record(folder / "finger-rig.h5"))
    samples = session.runs[0].load(list(BENCH_ORDER))
    units = ("s", "deg", "deg", "mNm", "deg", "deg", "N")
    factors = {"deg": 180.0 / math.pi, "mNm": 1000.0}
    columns = [samples[name] * factors.get(unit, 1.0) for name, unit in zip(BENCH_ORDER, units, strict=True)]
    titles = [f"{name.replace('_', ' ')} ({unit})" for name, unit in zip(BENCH_ORDER, units, strict=True)]
    rows = (";".join(f"{value:.5f}" for value in row).replace(".", ",") for row in zip(*columns, strict=True))
    Path("bench.csv").write_text("\n".join([";".join(titles), *rows]), encoding="utf-8")
    dialog = ImportDialog([Path("bench.csv")], window)
    dialog.show()
    dialog.columns.selectRow(5)
    yield "columns"
    dialog.close()


def free_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """Plots of one's own: a loop and a spectrum beside the running rig; a loop of a recorded run."""
    acquire.ask_to_close = lambda *_: True  # type: ignore[assignment]
    window.show_tab("acquire")
    tab = window.tab("acquire")
    assert isinstance(tab, acquire.AcquireTab)
    tab.controller._opener = lambda wanted: on_virtual_clock(wanted, folder)
    wait_until(lambda: not tab.controller.worker.busy)
    tab.controller.open(BenchRequest("simulated", effect=EFFECT))
    wait_until(lambda: tab.controller.bench is not None)
    tab.controller._timer.stop()
    for button, seconds in ((tab.panel.initialise, 0.2), (tab.panel.enable, 0.2), (tab.panel.start, 12.0)):
        button.click()
        for _ in range(round(seconds / 0.033)):
            tab.controller.tick()
    free = tab.plots.free
    tab.toolbar.arrange.add.click()
    tab.toolbar.arrange.add.click()
    free.plots[1].across.setCurrentIndex(free.plots[1].across.findData("frequency"))
    tab.toolbar.arrange.boxes["angles"].setChecked(False)
    yield "acquire"
    tab.controller.stop()
    tab.controller.tick()  # the virtual clock stands still else, and the head would say "Running"
    sessions = window.tab("sessions")
    assert isinstance(sessions, SessionsTab)
    library = Path("recordings")
    library.mkdir(exist_ok=True)
    record(library / "finger-rig.h5")
    window.show_tab("sessions")
    sessions.browse(library)
    wait_until(lambda: sessions.page.model.total == 1)
    sessions.page.choose_path(library / "finger-rig.h5")
    sessions.page.details.review.click()
    page = sessions.review_page
    wait_until(lambda: page.session is not None and not sessions.data.busy)
    page.arrange.add.click()
    page.arrange.add.click()
    across = page.free.plots[1].across
    across.setCurrentIndex(across.findData("mcp_angle"))
    page.free.wanted.emit()
    pause(500)
    wait_until(lambda: not sessions.data.busy)
    yield "review"


TABS: dict[str, States] = {
    "acquire": acquire_states,
    "calibrate": calibrate_states,
    "sessions": sessions_states,
    "fit": fit_states,
    "predict": predict_states,
    "model_lab": lab_states,
    "model_lab_practice": practice_states,
    "help": help_states,
    "free": free_states,
    "import": import_states,
}


def read_numbers(widget: QWidget) -> None:
    """Names and values of a calibration's result, two labels beside each other."""
    page = widget.findChild(ResultPage)
    assert page is not None
    for name, value in page._rows:
        FACTS[f"calibrate.{name.text()}"] = value.text()


def read_table(widget: QWidget, name: str, rows: Iterable[int]) -> None:
    """Cells of a table by row and column."""
    table = widget.findChild(QTableView)
    assert table is not None
    model = table.model()
    for row in rows:
        for column in range(model.columnCount()):
            FACTS[f"{name}.{row}.{column}"] = str(model.index(row, column).data() or "").replace("\n", " ")


def on_virtual_clock(wanted: BenchRequest, folder: Path) -> OpenBench:
    """The simulated rig, turned by hand."""
    effects = parse_effects((wanted.effect,) if wanted.effect else ())
    device = SimulatedRig(simulation=Simulation(seed=wanted.seed, effects=effects))
    settings = LoopSettings(BenchUnits.from_rig(device.rig), device.rig.limits)
    bench = InlineBench(device, settings, folder / "rescued")
    return OpenBench(bench, device.rig, dict(device.session_attributes))


def record(path: Path, seed: int = SEED) -> Path:
    """A session of the simulated rig with one effect that the nominal model lacks."""
    preset = load_preset()
    plans = PROTOCOLS["rich"](preset.numbers["protocol"]["contact_amplitude_deg"])
    write_session(path, preset, "rich", plans, parse_effects((EFFECT,)), seed)
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

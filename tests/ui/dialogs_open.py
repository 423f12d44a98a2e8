"""Every dialog of the program, and what opens it; menus of fields and of plots."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from PySide6.QtCore import QPoint
from PySide6.QtGui import QAction, QContextMenuEvent, QCursor
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QFileDialog,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QWhatsThis,
    QWidget,
)

from fingerlab.models.file import TriedModel
from fingerlab.prediction.comparing import ComparedModel, ModelComparison
from fingerlab.rig.file import default_rig
from fingerlab.ui.acquire.acquire_bars import FROM_FILE
from fingerlab.ui.acquire.acquire_tab import ask_to_close
from fingerlab.ui.acquire.connect_page import MODEL, ConnectPage
from fingerlab.ui.acquire.recording_control import DetailsDialog
from fingerlab.ui.app.window import MainWindow, ask_to_run
from fingerlab.ui.calibrate.calibrate_tab import ask_to_leave
from fingerlab.ui.lab.model_dialogs import NotesDialog, TriedDialog
from fingerlab.ui.lab.own_effects import DraftDialog, OwnEffects
from fingerlab.ui.lab.own_effects import ask_to_leave as ask_to_leave_text
from fingerlab.ui.sessions.import_dialog import ImportDialog
from fingerlab.ui.sessions.result_dialogs import TrialDialog
from fingerlab.ui.widgets.plot_figure import paper_of

from .hands import child
from .invented import invented_trial
from .lab.invented_law import invented_law
from .standing_open import Stage, Step, Surface, standing

# what is needed to open some of them


def _of(window: MainWindow, kind: type) -> Any:
    return window.findChildren(kind)[-1]


def _details(stage: Stage) -> None:
    stage.tab("acquire").panel.details.click()


def _choose_folder(stage: Stage) -> None:
    buttons = _of(stage.window, DetailsDialog).findChildren(QPushButton)
    next(button for button in buttons if button.text() == "Choose…").click()


def _own_effects(stage: Stage) -> None:
    stage.tab("model_lab").show_own_effects()


def _drafted(stage: Stage) -> None:
    dialog = DraftDialog(stage.tab("model_lab").pages)
    dialog.show_laws([invented_law()], None)
    dialog.show()


def _run_by_run(stage: Stage) -> None:
    session = SimpleNamespace(path=stage.session, rig=default_rig())
    found: Any = SimpleNamespace(
        first=session, second=session, pairs=(), only_first=(), only_second=(), refused=()
    )
    stage.tab("sessions").show_pair(found)


def _force_trial(stage: Stage) -> None:
    dialog = TrialDialog(stage.window)
    dialog.show_trial(invented_trial(), stage.session.name)
    dialog.show()


def _models_compared(stage: Stage) -> None:
    one = ComparedModel("model.json", ("coulomb_friction",), True, 1.1)
    stage.tab("predict").show_comparison(ModelComparison(stage.session, (one,)))


def _edit_own(stage: Stage) -> None:
    path, content = _own_file(stage)
    _of(stage.window, OwnEffects)._open(path, content.decode())


def _own_file(stage: Stage) -> tuple[Path, bytes]:
    path = stage.folder / "own.py"
    path.write_text("pass\n", encoding="utf-8")
    return path, path.read_bytes()


def _fit_save(stage: Stage) -> None:
    tab = stage.tab("fit")
    tab.found = tab.found or SimpleNamespace()
    tab.save()


def _save_wanted(stage: Stage) -> None:
    wanted = stage.tab("predict").wanted
    wanted.plan = SimpleNamespace(beyond=())
    wanted.ask_and_save()


def _texts(stage: Stage) -> list[Path]:
    path = stage.folder / "bench.txt"
    path.write_text("".join(f"{n / 1000} 0 0 0 0 0 0\n" for n in range(200)), encoding="utf-8")
    return [path]


def _import(stage: Stage) -> None:
    stage.tab("sessions").writer.import_texts(_texts(stage), stage.folder)


def _take_session(stage: Stage) -> None:
    dialog = QApplication.activeModalWidget()
    assert isinstance(dialog, QFileDialog)
    field = dialog.findChild(QLineEdit)
    assert isinstance(field, QLineEdit)
    field.setText(str(stage.session))
    dialog.accept()


def open_list(field: QComboBox) -> None:
    """Open a list, which gets two entries where it has none."""
    if field.count() == 0:
        field.blockSignals(True)
        field.addItems(["one", "two"])
        field.blockSignals(False)
    field.showPopup()


def _list_in(name: str) -> Step:
    """Opens a list of a dialog or a form."""
    return lambda stage: open_list(child(stage.window, QComboBox, name))


def _plot_of_ones_own(stage: Stage) -> None:
    free = stage.tab("acquire").plots.free
    if not free.plots:
        free.add()
    free.plots[0].across.showPopup()


def _trigger_form(stage: Stage) -> None:
    button = stage.tab("acquire").toolbar.trigger
    button.menu().popup(button.mapToGlobal(button.rect().bottomLeft()))


def _saved_model(stage: Stage) -> None:
    page: ConnectPage = stage.tab("acquire").connect_page
    page.effect.setCurrentIndex(page.effect.findData(MODEL))
    page.simulated.click()


def _first_plot(stage: Stage) -> QWidget:
    plot = stage.window.plots.current()
    assert plot is not None
    return plot


def _amplitude(stage: Stage) -> QWidget:
    field = stage.tab("acquire").panel.motion.numbers["amplitude_deg"].findChild(QLineEdit)
    assert isinstance(field, QWidget)
    return field


def _notes(stage: Stage) -> QWidget:
    notes = _of(stage.window, DetailsDialog).notes
    assert isinstance(notes, QPlainTextEdit)
    return notes.viewport()


def _log_over_stop(stage: Stage) -> None:
    stage.window.menus.log.trigger()
    dialog = standing(stage.window)[-1]
    button = stage.window.header.stop
    dialog.move(button.mapToGlobal(QPoint(-260, -100)))


def _context_menu(of: Callable[[Stage], QWidget]) -> Step:
    def open_it(stage: Stage) -> None:
        field = of(stage)
        field.setFocus()
        centre = field.rect().center()
        event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, centre, field.mapToGlobal(centre))
        QApplication.sendEvent(field, event)

    return open_it


def _menu_entry(window: MainWindow, words: str) -> QAction:
    (found,) = (a for a in window.findChildren(QAction) if a.text().replace("&", "").rstrip("…") == words)
    return found


def _about(stage: Stage) -> None:
    _menu_entry(stage.window, "About FingerLab").trigger()


DIALOGS = (
    Surface("Keys (F1)", (lambda s: _menu_entry(s.window, "Keys").trigger(),)),
    Surface("Log", (lambda s: s.window.menus.log.trigger(),), ("app/window.py:_show",)),
    Surface("Log, moved over STOP", (_log_over_stop,)),
    Surface(
        "Documents",
        (lambda s: _menu_entry(s.window, "Documents").trigger(),),
        ("app/documents.py:Documents",),
    ),
    Surface(
        "What is this?",
        (lambda s: _menu_entry(s.window, "What is this?").trigger(),),
        ready=QWhatsThis.inWhatsThisMode,
    ),
    Surface("What is this? > An answer", (lambda s: QWhatsThis.showText(QCursor.pos(), "It is.", s.window),)),
    Surface("About FingerLab", (_about,), ("app/window.py:MainWindow._about",)),
    Surface("Open session", (lambda s: s.window.ask_and_open(),), ("app/window.py:MainWindow.ask_and_open",)),
    Surface(
        "Save the plot",
        (lambda s: s.window.plots.ask_and_save(_first_plot(s)),),
        ("app/menus.py:SavePlotDialog",),
    ),
    Surface(
        "Save the plot > File",
        (lambda s: s.window.plots.save_as(_first_plot(s), paper_of(_first_plot(s))),),
        ("app/menus.py:PlotMenu.save_as",),
    ),
    Surface(
        "Save the plot > list of sizes",
        (lambda s: s.window.plots.ask_and_save(_first_plot(s)), _list_in("plotSize")),
    ),
    Surface("A plot of one's own > its list", (_plot_of_ones_own,)),
    Surface("Trigger > list of quantities", (_trigger_form, _list_in("triggerQuantity"))),
    Surface("Details of the session", (_details,), ("acquire/recording_control.py:DetailsDialog",)),
    Surface(
        "Details > Folder for recordings",
        (_details, _choose_folder),
        ("acquire/recording_control.py:DetailsDialog._choose",),
    ),
    Surface(
        "Stop and close? (Disconnect, Quit)",
        (lambda s: ask_to_close(s.tab("acquire").widget, "The amplifier is on"),),
        ("acquire/acquire_tab.py:ask_to_close",),
    ),
    Surface(
        "Model from a file",
        (lambda s: s.tab("acquire").toolbar.model_chosen.emit(FROM_FILE),),
        ("acquire/acquire_bars.py:LiveModelComparison._on_chosen",),
    ),
    Surface(
        "Trajectory file",
        (lambda s: s.tab("acquire").panel.motion.file.click(),),
        ("acquire/motion_form.py:MotionForm._choose_file",),
    ),
    Surface(
        "Table of runs",
        (lambda s: s.tab("acquire").panel.protocol.table.click(),),
        ("acquire/run_forms.py:ProtocolForm._choose_table",),
    ),
    Surface(
        "Keep this motion",
        (lambda s: _menu_entry(s.window, "Keep this motion").trigger(),),
        ("acquire/motion_form.py:MotionsButton._ask_name",),
    ),
    Surface(
        "Own device",
        (lambda s: s.tab("acquire").connect_page.own.click(),),
        ("acquire/connect_page.py:ConnectPage._browse_own",),
    ),
    Surface(
        "The bench of a saved model",
        (_saved_model,),
        ("acquire/connect_page.py:ConnectPage._simulated_wanted",),
    ),
    Surface(
        "Replay a recording",
        (lambda s: s.tab("acquire").connect_page.replay.click(),),
        ("acquire/connect_page.py:ConnectPage._on_replay",),
    ),
    Surface(
        "Rig file",
        (lambda s: s.tab("acquire").connect_page.rig.click(),),
        ("acquire/connect_page.py:ConnectPage._on_rig",),
    ),
    Surface(
        "Run an own file?",
        (lambda s: ask_to_run(s.window, *_own_file(s), False, "it"),),
        ("app/window.py:ask_to_run",),
    ),
    Surface(
        "Recording of a sensor",
        (lambda s: s.tab("calibrate").start_page.file_asked.emit("load-cell"),),
        ("calibrate/calibrate_tab.py:CalibrateTab._ask_for_files",),
        "calibrate",
    ),
    Surface(
        "Session to calibrate anew",
        (lambda s: s.tab("calibrate").start_page.again_asked.emit(),),
        ("calibrate/calibrate_tab.py:CalibrateTab._ask_for_session",),
        "calibrate",
    ),
    Surface(
        "Session to calibrate anew > Copy as",
        (lambda s: s.tab("calibrate").start_page.again_asked.emit(), _take_session),
        (),
        "calibrate",
    ),
    Surface(
        "Leave the calibration?",
        (lambda s: ask_to_leave(s.tab("calibrate").widget),),
        ("calibrate/calibrate_tab.py:ask_to_leave",),
        "calibrate",
    ),
    Surface(
        "Folder of sessions",
        (lambda s: s.tab("sessions").ask_folder(),),
        ("sessions/sessions_tab.py:SessionsTab.ask_folder",),
        "sessions",
    ),
    Surface(
        "Session to lay over",
        (lambda s: s.tab("sessions").review_beside(),),
        ("sessions/sessions_tab.py:SessionsTab.review_beside",),
        "sessions",
    ),
    Surface(
        "Folder for exported files",
        (lambda s: s.tab("sessions").writer.export(s.session, "csv"),),
        ("sessions/session_files.py:Writer.export",),
        "sessions",
    ),
    Surface(
        "Merge, cut, copy: new session",
        (lambda s: s.tab("sessions").writer.merge([s.session, s.session]),),
        ("sessions/session_files.py:Writer._ask_file",),
        "sessions",
    ),
    Surface(
        "Text files to import",
        (lambda s: s.tab("sessions").ask_texts(),),
        ("sessions/session_files.py:Writer.ask_texts",),
        "sessions",
    ),
    Surface("Import text files", (_import,), ("sessions/import_dialog.py:ImportDialog",), "sessions"),
    Surface(
        "Import text files > list of phases",
        (_import, lambda s: child(s.window, QComboBox, "importPhase0").showPopup()),
        (),
        "sessions",
    ),
    Surface(
        "Import text files > Rig file",
        (_import, lambda s: _of(s.window, ImportDialog).rig.click()),
        ("sessions/import_dialog.py:ImportDialog._choose_rig",),
        "sessions",
    ),
    Surface("Save model file (Fit)", (_fit_save,), ("fit/fit_tab.py:FitTab.save",), "fit"),
    Surface(
        "Add model files",
        (lambda s: s.tab("predict").ask_and_add(),),
        ("predict/predict_tab.py:PredictTab.ask_and_add",),
        "predict",
    ),
    Surface(
        "Wanted force",
        (lambda s: s.tab("predict").wanted.panel.wanted.file.click(),),
        ("widgets/wanted_fields.py:WantedFields._choose_file",),
        "predict",
    ),
    Surface(
        "Save trajectory", (_save_wanted,), ("predict/wanted_force.py:WantedView.ask_and_save",), "predict"
    ),
    Surface(
        "Save model",
        (lambda s: s.tab("model_lab").actions.ask_and_save(),),
        ("lab/validation.py:ResultActions.ask_and_save",),
        "model_lab",
    ),
    Surface(
        "Save report page",
        (lambda s: s.tab("model_lab").save_report(),),
        ("lab/model_lab_tab.py:ModelLabTab.save_report",),
        "model_lab",
    ),
    Surface(
        "Open a saved model",
        (lambda s: s.tab("model_lab").open_model(),),
        ("lab/model_lab_tab.py:ModelLabTab.open_model",),
        "model_lab",
    ),
    Surface(
        "Notes",
        (lambda s: NotesDialog(s.tab("model_lab").pages, "Clamped anew.", "day.project.json").open(),),
        ("lab/model_dialogs.py:NotesDialog",),
        "model_lab",
    ),
    Surface(
        "Models tried",
        (lambda s: TriedDialog(s.tab("model_lab").pages, [TriedModel((), 12.4)], ((), ())).open(),),
        ("lab/model_dialogs.py:TriedDialog",),
        "model_lab",
    ),
    Surface(
        "What the error is made of",
        (lambda s: s.tab("model_lab").view.show_score_parts(),),
        ("lab/model_dialogs.py:ScorePartsDialog",),
        "model_lab",
    ),
    Surface(
        "What would mend the error",
        (lambda s: s.tab("model_lab").view.show_budget(),),
        ("lab/budget.py:BudgetDialog",),
        "model_lab",
    ),
    Surface(
        "What would mend the error > its list",
        (lambda s: s.tab("model_lab").view.show_budget(), _list_in("budgetFamily")),
        (),
        "model_lab",
    ),
    Surface(
        "Drafted laws",
        (_drafted,),
        ("lab/own_effects.py:DraftDialog",),
        "model_lab",
    ),
    Surface(
        "Models side by side",
        (lambda s: s.tab("model_lab").view.show_side_by_side(),),
        ("lab/model_dialogs.py:SideBySideDialog",),
        "model_lab",
    ),
    Surface(
        "Models side by side > list of models",
        (lambda s: s.tab("model_lab").view.show_side_by_side(), _list_in("modelA")),
        (),
        "model_lab",
    ),
    Surface(
        "Two sessions run by run",
        (_run_by_run,),
        ("sessions/result_dialogs.py:PairsDialog",),
        "sessions",
    ),
    Surface(
        "Force trial",
        (_force_trial,),
        ("sessions/result_dialogs.py:TrialDialog",),
        "sessions",
    ),
    Surface(
        "Model of a force trial",
        (lambda s: s.tab("acquire").panel.protocol.trial.model.click(),),
        ("acquire/force_trial_form.py:ForceTrialFields._choose",),
        "acquire",
    ),
    Surface(
        "Models compared",
        (_models_compared,),
        ("predict/force_panel.py:ModelsDialog",),
        "predict",
    ),
    Surface(
        "The thesis' experiment again",
        (lambda s: s.tab("fit").show_replicate(),),
        ("fit/fit_view.py:ReplicateDialog",),
        "fit",
    ),
    Surface(
        "Trend over days",
        (lambda s: s.tab("sessions").show_trend(),),
        ("sessions/trend_dialog.py:TrendDialog",),
        "sessions",
    ),
    Surface(
        "Trend over days > list of benches",
        (lambda s: s.tab("sessions").show_trend(), _list_in("firstBench")),
        (),
        "sessions",
    ),
    Surface(
        "Own effects > New",
        (_own_effects, lambda s: _of(s.window, OwnEffects).write_new()),
        ("lab/own_effects.py:OwnEffects.write_new.ask",),
        "model_lab",
    ),
    Surface(
        "Own effects > Edit",
        (_own_effects, _edit_own),
        ("lab/own_effects.py:EffectEditor",),
        "model_lab",
    ),
    Surface(
        "Own effects > Edit > Leave it as it was?",
        (lambda s: ask_to_leave_text(s.window, s.folder / "own.py"),),
        ("lab/own_effects.py:ask_to_leave",),
        "model_lab",
    ),
    Surface("Own effects", (_own_effects,), ("lab/own_effects.py:OwnEffects",), "model_lab"),
    Surface(
        "Own effects > Folder",
        (_own_effects, lambda s: _of(s.window, OwnEffects).choose.click()),
        ("lab/own_effects.py:OwnEffects._choose",),
        "model_lab",
    ),
    Surface(
        "Own effects > Run it?",
        (
            _own_effects,
            lambda s: ask_to_run(_of(s.window, OwnEffects), *_own_file(s), True, "it"),
        ),
        (),
        "model_lab",
    ),
    Surface(
        "Menu of a plot", (lambda s: s.window.plots.open(_first_plot(s), QCursor.pos() + QPoint(40, 200)),)
    ),
    Surface("Menu of a text field", (_context_menu(lambda s: s.tab("acquire").panel.note),)),
    Surface(
        "Menu of a number field",
        (_context_menu(_amplitude),),
    ),
    Surface(
        "Menu of a text in a dialog",
        (_details, _context_menu(_notes)),
    ),
)  # fmt: skip

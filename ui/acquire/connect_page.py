"""Shown while no rig is connected: what was found, in a plain sentence, and what can be used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QComboBox, QFileDialog, QLabel, QPushButton, QWidget

from fingerlab.core.errors import UserError

from ..app.context import ApplicationContext
from ..app.window import ask_to_run as ask
from ..lab import practice
from ..widgets.fields import (
    WholeField,
    across,
    centred_column,
    choice,
    number,
    refuse_entries,
    set_usable,
    take_typed,
)
from ..widgets.layout import as_written, described
from ..widgets.tables import WholeLabel, heading, whole_remark
from .bench_setup import BenchRequest, forget_own_device, own_device_file, own_device_files

if TYPE_CHECKING:
    from fingerlab.core.trust import OwnSource
    from fingerlab.devices.protocol import FoundDevice

COLUMN_WIDTH = 640
BUTTON_WIDTH = 168
RIG_FILTER = "Rig files (*.toml);;All files (*)"
DEFAULT_RIG = (
    "Default rig: wiring and limits as in the thesis, a card in this machine. A rig file names others, and "
    "the device server of a card in another machine."
)
CHECKED = {"card": "the card", "simulated": "the simulated rig, as a rehearsal", "own": "the own device"}
MODEL = "model"
MODEL_FILTER = "Saved models (*.json);;All files (*)"
PYTHON_FILTER = "Python files (*.py);;All files (*)"
SESSION_FILTER = "Session files (*.h5 *.hdf5);;All files (*)"


class ConnectPage(QWidget):
    """Signals: chosen(Wanted); look_asked: for devices, with the rig file of now; runs_asked(Path);
    refused(str): a sentence on what could not be done.
    """

    chosen = Signal(object)
    look_asked = Signal()
    runs_asked = Signal(object)
    refused = Signal(str)

    def __init__(self, context: ApplicationContext, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.rig_file: Path | None = None
        self._folder = context.settings.folder()
        self._card = ""
        self._session: Path | None = None
        self.title = heading("No rig connected", large=True)
        self._make_simulated()
        self._make_card()
        self._make_own()
        self._make_replay()
        self._make_check()
        self._make_practice()
        self._build()
        self.card.clicked.connect(lambda: self._ask_for(self._card_wanted()))
        self.again.clicked.connect(self.look_asked)
        self.simulated.clicked.connect(lambda: self._ask_for(self._simulated_wanted()))
        self.fault.currentIndexChanged.connect(self._on_fault)
        self.own.clicked.connect(lambda: self._ask_for(self._own_wanted()))
        self.check.clicked.connect(self._on_check)
        self.own_file.currentIndexChanged.connect(self._on_own_file)
        self.forget.clicked.connect(self._on_forget)
        self.replay.clicked.connect(self._on_replay)
        self.replay_run.clicked.connect(self._on_replay_run)
        self.rig.clicked.connect(self._on_rig)
        self.practise.clicked.connect(lambda: practice.start(context))
        context.protocol_handed.connect(lambda _steps, title: self.show_waiting(title or "A protocol"))
        context.bench_changed.connect(lambda: self.show_waiting(""))
        self._on_fault()

    def _make_simulated(self) -> None:
        self.simulated = _button("&Simulated rig", "connectSimulated")
        self.simulated.setProperty("primary", "true")
        self.effect: QComboBox = choice(
            "simulatedEffect",
            {
                "": "without a missing effect",
                "hidden": "with a hidden effect",
                MODEL: "as a saved model has it …",
            },
            "Effect: what the simulated rig has that the nominal model lacks; or the bench that a model "
            "found, its values drawn from their uncertainty by the number of the bench.",
        )
        self.effect.setMinimumContentsLength(24)
        self.seed = described(WholeField(), "simulatedSeed", accessible="Number of the simulated bench")
        self.seed.setRange(0, 99_999)
        self.seed.setPrefix("bench ")
        self.seed.setToolTip(
            "Each number is another bench: other tolerances, other noise, another hidden effect."
        )
        self.fault: QComboBox = choice(
            "simulatedFault", {"": "nothing goes wrong"}, "Fault: what goes wrong with the simulated rig."
        )
        self.fault.setMinimumContentsLength(24)
        self.fault_after = number(
            "faultAfter",
            20.0,
            1.0,
            3600.0,
            1,
            5.0,
            "Seconds until the fault: counted from connecting, and again after each stop.",
        )
        self.fault_after.setPrefix("after ")
        self.fault_after.setSuffix(" s")

    def _make_card(self) -> None:
        self.found = described(WholeLabel("Looking for a data acquisition card …"), "foundSentence")
        self.found.setTextFormat(Qt.TextFormat.PlainText)
        self.card = _button("Connect to the &card", "connectCard")
        self.card.setEnabled(False)
        self.again = _button("Look a&gain", "lookAgain")
        self.again.setToolTip("A card was plugged in, or a device server started.")
        self.rig = _button("Rig f&ile…", "rigFile")
        self.rig_text = whole_remark(DEFAULT_RIG)

    def _make_own(self) -> None:
        self.own = _button("&Own device", "connectOwn")
        self.own.setToolTip(
            "A Python file of yours that drives other hardware; you are asked before it is run."
        )
        self.own_file: QComboBox = choice("ownFile", {}, "File of an own device.")
        self.forget = _button("Forget &it", "forgetOwn")
        self.forget.setToolTip("Take it from the list; you are asked again before this file is run.")
        self._offer_own(())

    def _make_replay(self) -> None:
        self.replay = _button("&Replay a recording…", "connectReplay")
        self.replay_text = whole_remark("A recorded run as if it were measured now; nothing moves it.")
        self.runs = choice("replayRun", {}, "Run that is replayed.")
        self.replay_run = _button("Replay &this run", "replayThis")
        self.replay_run.setProperty("primary", "true")
        for field in (self.runs, self.replay_run):
            field.hide()

    def _make_check(self) -> None:
        self.check = _button("Check the ri&g", "checkRig")
        self.check.setToolTip(
            "Step by step: channels, signs, scaling, limits, drive and stop, with the cable off the pulley."
        )
        self.checked: QComboBox = choice("checkedBench", CHECKED, "Bench that is checked.")
        self.checked.setMinimumContentsLength(24)
        self._offer_check()

    def _make_practice(self) -> None:
        self.practise = _button("&Practise", "practiseFromHere")
        self.practise.setAccessibleName("Practise on a hidden effect")
        self.practise_text = whole_remark(
            "On a hidden effect, without any rig: a session is simulated in seconds and opens in the Model "
            "lab. A session that you have opens with Ctrl+O, or drop it here."
        )
        self.waiting = described(QLabel(textFormat=Qt.TextFormat.PlainText, wordWrap=True), "waitsForRig")
        self.waiting.hide()

    def _build(self) -> None:
        inner = centred_column(self, COLUMN_WIDTH)
        inner.addWidget(self.title)
        inner.addWidget(self.waiting)
        inner.addWidget(
            whole_remark(
                "Connect one to see it live, drive it and record it. The simulated rig works in the same way "
                "as the real one."
            )
        )
        room = QLabel("Fault, for practice")
        for entries in (
            (self.simulated, self.effect, self.seed),
            (room, self.fault, self.fault_after),
            (self.card, self.found, self.again),
            (self.own, self.own_file, self.forget),
            (self.replay, self.replay_text, self.runs, self.replay_run),
            (self.rig, self.rig_text),
            (
                self.check,
                self.checked,
                whole_remark("Without it a real bench gets a tenth of its current."),
            ),
            (self.practise, self.practise_text),
        ):
            entries[0].setMinimumWidth(BUTTON_WIDTH)
            inner.addLayout(across(*entries))

    # what is shown

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._offer_own(own_device_files())

    def _offer_own(self, files: Sequence[Path]) -> None:
        """Offer these files, and any other."""
        self.own_file.clear()
        for path in files:
            self.own_file.addItem(path.name, path)
            self.own_file.setItemData(
                self.own_file.count() - 1, as_written(str(path)), Qt.ItemDataRole.ToolTipRole
            )
        self.own_file.addItem("another Python file …" if files else "a Python file …", None)
        self._on_own_file()

    def show_waiting(self, what: str) -> None:
        """What was handed over or dropped before a rig was there; empty once it is."""
        self.waiting.setText(f"{what} waits for a rig: connect one, and it stands ready in the panel there.")
        self.waiting.setVisible(bool(what))

    def show_looking(self) -> None:
        """A card is looked for."""
        self.found.setText("Looking for a data acquisition card …")

    def show_not_looked(self) -> None:
        """The rig file could not be used: the default one is."""
        self.rig_file = None
        self.rig_text.setText(DEFAULT_RIG)
        self._card = ""
        self.card.setEnabled(False)
        self.found.setText("No card was looked for; look again, or choose another rig file.")
        self._offer_check()

    def show_found(self, found: Sequence[FoundDevice]) -> None:
        """The card, and whether it can be used."""
        card = found[0]
        self._card = card.name
        self.found.setText(card.sentence[:1].upper() + card.sentence[1:] + ".")
        self.card.setEnabled(card.available)
        self.card.setToolTip("" if card.available else self.found.text())
        self._offer_check()
        simulated = next((one for one in found if one.name == "simulated"), None)
        if simulated is not None and not simulated.available:
            self.simulated.setEnabled(False)
            self.simulated.setToolTip(simulated.sentence)

    def show_choices(self, effects: Sequence[tuple[str, str]], faults: Sequence[tuple[str, str]]) -> None:
        """Offer effects and faults of the simulated rig."""
        for key, title in effects:
            self.effect.addItem(f"with {title[:1].lower()}{title[1:]}", key)
        for key, title in faults:
            self.fault.addItem(title, key)

    def show_runs(self, session: Path, runs: Sequence[tuple[str, str]]) -> None:
        """Offer the runs of a session; the only one is taken at once."""
        self._session = session
        self.runs.clear()
        for name, words in runs:
            self.runs.addItem(words, name)
        many = len(runs) > 1
        self.replay_text.setVisible(not many)
        self.runs.setVisible(many)
        self.runs.setToolTip(as_written(f"Run of {session.name} that is replayed."))
        self.replay_run.setVisible(many)
        if many:
            self.runs.setFocus()
        else:  # a session without runs is refused with a sentence by the replay itself
            self.chosen.emit(BenchRequest(f"replay:{session}"))

    def show_busy(self, what: str) -> None:
        """While something is being connected, say so."""
        self.title.setText(f"{what} …" if what else "No rig connected")
        for button in (
            self.simulated,
            self.own,
            self.forget,
            self.replay,
            self.replay_run,
            self.rig,
            self.again,
            self.check,
            self.practise,
        ):
            set_usable(button, not what)
        set_usable(self.card, not what and bool(self._card) and not self.card.toolTip())

    # hand

    def _ask_for(self, wanted: BenchRequest | None) -> None:
        if wanted is not None:
            self.chosen.emit(wanted)

    def _on_check(self) -> None:
        which = {"card": self._card_wanted, "simulated": self._simulated_wanted, "own": self._own_wanted}
        wanted = which[str(self.checked.currentData())]()
        self._ask_for(wanted and replace(wanted, check=True))

    def _offer_check(self) -> None:
        """The card first, where there is one."""
        there = self.card.isEnabled()
        refuse_entries(self.checked, {"card": "" if there else "There is no card that can be used."})
        self.checked.setCurrentIndex(self.checked.findData("card" if there else "simulated"))

    def _card_wanted(self) -> BenchRequest:
        return BenchRequest(self._card, self.rig_file)

    def _simulated_wanted(self) -> BenchRequest | None:
        if take_typed([self.seed, self.fault_after]):  # the field says what is wrong
            return None
        effect, preset = str(self.effect.currentData()), "practice"
        if effect == MODEL:
            title = "A saved model, whose bench is simulated"
            preset = QFileDialog.getOpenFileName(self, title, str(self._folder), MODEL_FILTER)[0]
            if not preset:
                return None
            effect = ""
        return BenchRequest(
            "simulated",
            self.rig_file,
            effect,
            self.seed.value(),
            preset=preset,
            fault=str(self.fault.currentData()),
            fault_after_s=self.fault_after.value(),
        )

    def _on_fault(self) -> None:
        self.fault_after.setEnabled(bool(self.fault.currentData()))

    def _own_wanted(self) -> BenchRequest | None:
        path = self.own_file.currentData() or self._browse_own()
        if path is None:
            return None
        file = own_device_file(path)
        if file is not None and file.state != "trusted" and not ask_to_run(self, file):
            return None
        others = [one for one in own_device_files() if one != path]
        self._offer_own([path, *others])  # who puts it right and tries again finds it chosen
        return BenchRequest(f"own:{path}", self.rig_file, own=file)

    def _on_own_file(self) -> None:
        self.forget.setVisible(self.own_file.currentData() is not None)

    def _on_forget(self) -> None:
        path = self.own_file.currentData()
        try:
            forget_own_device(path)
        except UserError as error:
            self.refused.emit(str(error))
        self._offer_own(own_device_files())
        self.own_file.setFocus()  # the button is gone where none is left

    def _browse_own(self) -> Path | None:
        known = own_device_files()
        folder = str(known[0].parent) if known else self._folder
        name, _ = QFileDialog.getOpenFileName(self, "Own device", folder, PYTHON_FILTER)
        return Path(name).resolve() if name else None

    def _on_replay(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Replay a recording", self._folder, SESSION_FILTER)
        if name:
            self.runs_asked.emit(Path(name))

    def _on_replay_run(self) -> None:
        self.chosen.emit(BenchRequest(f"replay:{self._session}#{self.runs.currentData()}"))

    def _on_rig(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Rig file", self._folder, RIG_FILTER)
        if name:
            self.rig_file = Path(name)
            self.rig_text.setText(name)
            self.look_asked.emit()


def ask_to_run(parent: QWidget, file: OwnSource) -> bool:
    """Whether a file that is new, or was changed, may be run."""
    return ask(parent, file.path, file.content, file.state == "changed", "it drives the motor, and")


def _button(text: str, name: str) -> QPushButton:
    return described(QPushButton(text), name)

"""Above the plots of Acquire: device, what to do, time and trigger; the menu; the model beside it all."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFileDialog,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QStackedWidget,
    QToolButton,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.core.text import ScreenUnit
from fingerlab.sessions.model import FINGER_PHASES

from ..app.context import ApplicationContext
from ..app.tab_registry import SEPARATOR, Command
from ..widgets.fields import NumberField, choice, form_menu, refuse_entries
from ..widgets.free_plots import PlotsButton
from ..widgets.layout import WrappedRow, described, hbox
from ..widgets.tables import ElidedLabel, header_name, heading
from .acquire_panel import AcquirePanel
from .bench_controller import BenchController
from .live_history import PLOTS, QUANTITIES, SHOWN
from .live_pane import WITH_ERROR
from .live_plots import WINDOWS_S, LivePlots, Trigger, level_of
from .recording_control import RecordingControl

if TYPE_CHECKING:
    from fingerlab.models.live import Balance


LONGEST_NAME = 24
"""Letters of a device's name that are seen in any window; a longer one is whole in its tooltip."""
FINE = ("released", "ready", "held", "beating")
"""How a line's state ends where it hinders nothing."""


class AcquireHeader(QWidget):
    """Signals: disconnect_asked; open_asked(path)."""

    disconnect_asked = Signal()
    open_asked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name = header_name("deviceName", "Device", alone=False)
        self.lines = ElidedLabel()
        self.lines.setObjectName("safetyLines")
        self.lines.setAccessibleName("Emergency stop, amplifier and dead-man")
        self.disconnect_button = QPushButton("Disconnect")
        self.disconnect_button.setObjectName("disconnect")
        self.disconnect_button.setToolTip("Stop the motor and let the device go, to choose another.")
        self.open = described(QPushButton("Look at the recording"), "openRecording")
        self._path = ""
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 0, 8, 0)
        layout.setSpacing(8)
        layout.addWidget(self.name, 1)
        layout.addWidget(self.lines, 2)
        layout.addWidget(self.open)
        layout.addWidget(self.disconnect_button)
        self.open.hide()
        self.open.clicked.connect(lambda: self.open_asked.emit(self._path))
        self.disconnect_button.clicked.connect(self.disconnect_asked)

    def show_device(self, name: str, in_protocol: bool) -> None:
        """Which device is connected."""
        self.name.setText(name[:1].upper() + name[1:] if name else "")
        letters = self.name.fontMetrics()
        most = LONGEST_NAME * letters.averageCharWidth()
        self.name.setMinimumWidth(min(letters.horizontalAdvance(self.name.text()), most) + 1)
        self.disconnect_button.setVisible(bool(name))
        self.disconnect_button.setEnabled(not in_protocol)

    def show_lines(self, words: Mapping[str, str], unchecked: bool = False) -> None:
        """State of the bench's digital lines, each in words; nothing where no bench is connected.

        Args:
            unchecked: no check has confirmed the bench, whose current is therefore limited.
        """
        states = [f"{name[:1].upper()}{name[1:]} {word}" for name, word in words.items()]
        if unchecked:
            states = ["Not checked: little current", *states]
        wired = [line for line in states if not line.endswith("not wired")]
        short = " · ".join(wired) or ("No emergency stop input" if states else "")
        if self.lines.text() != " · ".join(states):
            fine = wired and all(line.endswith(FINE) for line in wired)
            worst = next((line for line in wired if not line.endswith(FINE)), short)
            self.lines.set_texts(
                [" · ".join(states), short, *(("Lines ready", "✓") if fine else (worst, "⚠"))]
            )

    def show_written(self, path: Path) -> None:
        """Offer what was just recorded."""
        self._offer(path, "Look at the recording", f"Open {path.name} in the Model lab.")

    def show_put_off(self, path: Path) -> None:
        """Offer to finish what was put off."""
        self._offer(
            path, "Finish the recording", f"Write and verify {path.name}, and open it in the Model lab."
        )

    def _offer(self, path: Path, text: str, help_text: str) -> None:
        self._path = str(path)
        self.open.setText(text)
        self.open.setToolTip(help_text)
        self.open.show()


class PromptBar(QFrame):
    """In the place of the plots' tools while something is asked: nothing moves.

    Signals: done; came(bool): there is something to do, or no more.
    """

    done = Signal()
    came = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("promptBar")
        self.setAccessibleName("What to do now")
        self.sentence = described(heading(), "prompt")
        self.sentence.setWordWrap(True)
        self.button = QPushButton("&Done")
        self.button.setObjectName("promptDone")
        self.button.setProperty("primary", "true")
        self.button.setToolTip("It is done: go on with the protocol (Ctrl+D).")
        self.button.clicked.connect(self._on_done)
        hbox(self, (self.sentence, 1), self.button, margins=(16, 4, 8, 4), spacing=16)

    def ask(self, sentence: str) -> None:
        """Show what to do."""
        self.sentence.setText(sentence)
        self.setAccessibleDescription(sentence)
        self.came.emit(True)
        self.button.setFocus()

    def over(self) -> None:
        """Nothing is asked any more."""
        self.sentence.clear()  # its room is not kept
        self.came.emit(False)

    def _on_done(self) -> None:
        self.over()
        self.done.emit()


class AbovePlots(QStackedWidget):
    """The plots' tools, or what the operator has to do; as high as the higher of them."""

    def __init__(self, tools: QWidget, prompt: PromptBar, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.addWidget(tools)
        self.addWidget(prompt)
        prompt.came.connect(lambda on: self.setCurrentWidget(prompt if on else tools))


NO_MODEL, NOMINAL, FROM_FILE, FILE = "none", "nominal", "choose", "file"
MODELS = {NO_MODEL: "No model", NOMINAL: "Nominal model", FROM_FILE: "Model from a file…"}


class PlotToolbar(QWidget):
    """Signal ``model_chosen(key)``."""

    model_chosen = Signal(str)

    def __init__(self, plots: LivePlots, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._plots = plots
        self.window_s = choice(
            "timeWindow", {str(s): f"{s:g} s" for s in WINDOWS_S}, "Time shown: how much of it."
        )
        self.window_s.setMinimumContentsLength(5)
        self.window_s.setCurrentIndex(2)
        self.hold = _switch("hold", "H&old", "Keep the picture still; the bench goes on (Ctrl+P).")
        self.cursors = _switch("cursors", "C&ursors", "Two cursors to drag, with differences (Ctrl+K).")
        self.trigger = TriggerButton(plots)
        self.arrange = PlotsButton(plots.free)
        self.model = choice(
            "model", MODELS, "Model: its torque and force over the measured ones, with what is left."
        )
        self.model.setMinimumContentsLength(11)
        self.times = described(ElidedLabel(), "cursorTimes", accessible="Times of the cursors")
        self.differences = described(ElidedLabel(), "cursorText", accessible="At the cursors")
        switches = (self.window_s, self.hold, self.cursors, self.trigger, self.arrange, plots.free.switch)
        row = WrappedRow((*switches, (self.times, 1), self.model))
        layout = QGridLayout(self)
        layout.setContentsMargins(8, 4, 8, 0)
        layout.setSpacing(4)
        layout.addWidget(row, 0, 0)
        layout.addWidget(self.differences, 1, 0)
        self.differences.hide()
        self.window_s.activated.connect(self._on_window)
        self.hold.toggled.connect(self._on_hold)
        self.cursors.toggled.connect(plots.show_cursors)
        plots.held_changed.connect(self._on_held)
        plots.cursors_moved.connect(self._tell)
        self.model.activated.connect(lambda: self.model_chosen.emit(str(self.model.currentData())))

    def show_model(self, key: str, path: Path | None = None) -> None:
        """Which model is shown."""
        row = self.model.findData(FILE)
        if path is not None:
            if row < 0:
                row = self.model.count() - 1
                self.model.insertItem(row, "", FILE)
            self.model.setItemText(row, path.stem)
        self.model.setCurrentIndex(self.model.findData(key))

    def refuse_models(self, why: str) -> None:
        """No model can be chosen now; empty: it can."""
        refuse_entries(self.model, dict.fromkeys((NOMINAL, FROM_FILE, FILE), why))

    def _on_window(self) -> None:
        self._plots.set_window(float(self.window_s.currentData()))

    def _on_hold(self, on: bool) -> None:
        self._plots.hold(on)
        self._plots.refresh()

    def _on_held(self, on: bool) -> None:
        self.hold.setChecked(on)
        self.hold.setText("Go &live" if on else "H&old")

    def _tell(self, times: str, differences: str, values: str) -> None:
        for label, text in ((self.times, times), (self.differences, differences)):
            label.setText(text)
            label.setToolTip(values)
        self.differences.setVisible(bool(differences))


class TriggerButton(QToolButton):
    """Opens a small form: on or off, which quantity, which level, upwards or downwards."""

    def __init__(self, plots: LivePlots, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._plots = plots
        self.setObjectName("trigger")
        self.setAccessibleName("Trigger")
        self.setToolTip("Start the picture where a quantity crosses a level (Ctrl+G).")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        form = QWidget()
        self.on = described(QCheckBox("&Trigger"), "triggerOn")
        self.quantity: QComboBox = choice(
            "triggerQuantity", {name: QUANTITIES[name].title for name in SHOWN}, "Quantity that triggers."
        )
        self.quantity.setCurrentIndex(1)
        self.edge = choice(
            "triggerEdge", {"rising": "Rising", "falling": "Falling"}, "Direction of crossing."
        )
        self.level = described(NumberField(), "triggerLevel", accessible="Level")
        self.level.setRange(-1e5, 1e5)
        self.level.setDecimals(2)
        layout = QGridLayout(form)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.addWidget(self.on, 0, 0, 1, 2)
        self._unit = QLabel(f"&Level ({self._shown_unit().symbol})")
        self._unit.setBuddy(self.level)
        for row, (label, field) in enumerate(
            ((QLabel("Quantity"), self.quantity), (QLabel("Edge"), self.edge), (self._unit, self.level)), 1
        ):
            layout.addWidget(label, row, 0)
            layout.addWidget(field, row, 1)
        form_menu(self, form)
        self.on.toggled.connect(self._on_toggled)
        self.quantity.activated.connect(self._on_quantity)
        self.edge.activated.connect(self._apply)
        self.level.valueChanged.connect(self._apply)
        self._apply()

    def _on_toggled(self, on: bool) -> None:
        if on:
            self._on_quantity()
        self._apply()

    def _shown_unit(self) -> ScreenUnit:
        return QUANTITIES[str(self.quantity.currentData())].unit

    def _on_quantity(self) -> None:
        column, unit = str(self.quantity.currentData()), self._shown_unit()
        self._unit.setText(f"&Level ({unit.symbol})")
        self.level.setValue(level_of(self._plots.history, column) * unit.factor)
        self._apply()

    def _apply(self) -> None:
        column = str(self.quantity.currentData())
        level = self.level.value() / QUANTITIES[column].unit.factor
        self._plots.trigger = Trigger(self.on.isChecked(), column, level, self.edge.currentData() == "rising")
        self._plots.triggered_at = None
        self.setText(
            f"Trigger: {QUANTITIES[column].title.lower()}" if self.on.isChecked() else "Trigger: off"
        )


def _switch(name: str, text: str, help_text: str) -> QPushButton:
    button = described(QPushButton(text), name)
    button.setCheckable(True)
    button.setToolTip(help_text)
    return button


def acquire_menu(
    panel: AcquirePanel,
    bar: PlotToolbar,
    plots: LivePlots,
    prompt: PromptBar,
    recording: RecordingControl,
    take_moment: Callable[[], Any],
    disconnect: Callable[[], Any],
) -> tuple[Command, ...]:
    """All that can be done on the tab; a key does what its button does."""

    def connected() -> bool:
        return recording.controller.bench is not None

    def press(text: str, button: Any, keys: str) -> Command:
        return Command(text, button.click, keys, lambda: connected() and button.isEnabled())

    return (
        press("&Initialise", panel.initialise, "Ctrl+I"),
        press("Reset &load cell", panel.tare, "Ctrl+T"),
        press("&Enable or disable", panel.enable, "Ctrl+E"),
        press("&Release stop", panel.release, "Ctrl+L"),
        press("Reset &fault", panel.reset, "Ctrl+Shift+L"),
        SEPARATOR,
        press("&Start or change", panel.start, "Ctrl+Return"),
        press("To res&t", panel.finish, "Ctrl+Backspace"),
        press("Run &protocol", panel.run, "Ctrl+Shift+Return"),
        Command("&Done as asked", prompt.button.click, "Ctrl+D", prompt.isVisible),
        SEPARATOR,
        press("Re&cord or end run", panel.record, "Ctrl+R"),
        press("Pause recording", panel.pause, "Ctrl+Shift+P"),
        Command("&Marker with a note", take_moment, "Ctrl+M", lambda: panel.mark.isEnabled()),
        press("&Write to file", panel.write, "Ctrl+S"),
        Command("Finish writing l&ater", panel.later.click, None, lambda: recording.writing.under_way),
        SEPARATOR,
        Command("&Hold the picture", bar.hold.toggle, "Ctrl+P", connected, bar.hold.isChecked),
        Command("C&ursors", bar.cursors.toggle, "Ctrl+K", connected, bar.cursors.isChecked),
        Command("Tri&gger", bar.trigger.on.toggle, "Ctrl+G", connected, bar.trigger.on.isChecked),
        Command("Scroll &back", lambda: plots.scroll_by(-0.5), "Alt+Left", connected),
        Command("Scroll for&ward", lambda: plots.scroll_by(0.5), "Alt+Right", connected),
        SEPARATOR,
        Command("Disco&nnect", disconnect, None, connected),
    )


MODEL_FILTER = "Model files (*.json);;All files (*)"


class LiveModelComparison(QObject):
    """Follows the choice in the toolbar and the set-up of the bench."""

    def __init__(
        self, context: ApplicationContext, controller: BenchController, toolbar: PlotToolbar, plots: LivePlots
    ) -> None:
        super().__init__(controller)
        self._context, self._controller, self._toolbar, self._plots = context, controller, toolbar, plots
        self._balance: Balance | None = None
        self._path: Path | None = None
        self._key = NO_MODEL
        toolbar.model_chosen.connect(self._on_chosen)

    def show(self) -> None:
        """Compare anew: another bench, another phase or cable."""
        self._toolbar.refuse_models(self._refusal())
        key = self._key
        if key == FILE and self._path is not None:
            self._load(self._path)
        try:
            self._controller.compare(self._balance if key == FILE else None, key in (NOMINAL, FILE))
        except UserError as error:
            self._context.tell(str(error))
            self._key = key = NO_MODEL
        self._toolbar.show_model(key, self._path if key == FILE else None)
        modelled = self._controller.model is not None
        self._plots.show_model(modelled, modelled and self._controller.set_up.phase == "contact")
        self._plots.refresh()

    def _refusal(self) -> str:
        """Why no model can stand beside what is measured now; empty where one can."""
        opened = self._controller.opened
        if opened is None:
            return ""
        if opened.rig.finger is None or opened.rig.motor.pulley_radius is None:
            return "The rig names no finger or no pulley radius; there is nothing to model."
        if self._controller.set_up.phase not in FINGER_PHASES:
            return "A model is of the finger; choose the phase On air or Contact."
        return ""

    def show_errors(self) -> None:
        """What the model leaves over now."""
        model = self._controller.model
        if model is None:
            return
        for spec in PLOTS:
            if spec.key in WITH_ERROR:
                error = model.error(spec.key)
                label = self._plots.panes[spec.key].error
                label.show_value(error)
                error_words = label.text().removeprefix("error ")
                label.setToolTip(
                    f"Error of the model, {error_words}: root mean square of measured less modelled over the "
                    "last seconds. The model is "
                    f"{1e3 * model.delay_s:.0f} ms behind the measurement."
                )

    def _on_chosen(self, key: str) -> None:
        if key == FROM_FILE:
            name, _ = QFileDialog.getOpenFileName(
                self._toolbar, "Model", self._context.settings.folder(), MODEL_FILTER
            )
            if not name or not self._load(Path(name)):
                self._toolbar.show_model(self._key)
                return
            key = FILE
        self._key = key
        self.show()

    def _load(self, path: Path) -> bool:
        from fingerlab.models.file import load_model
        from fingerlab.models.live import balance_of

        try:
            self._balance = balance_of(load_model(path), self._controller.set_up.cable, path.name)
        except UserError as error:
            self._context.tell(str(error), traceback.format_exc())
            return False
        self._path = path
        return True

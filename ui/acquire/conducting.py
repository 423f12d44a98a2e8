"""The protocol on the tab: begun by its button, its prompts across the plots, its countdown in the panel."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject

from fingerlab.acquisition.bench import Status
from fingerlab.acquisition.commands import SetUp
from fingerlab.acquisition.protocol import countdown
from fingerlab.acquisition.trajectories import read_trajectory
from fingerlab.core.errors import UserError

from ..desk import Desk
from .panel import Panel
from .prompt_bar import PromptBar
from .protocol_run import ProtocolRun
from .recording import Recording


class Conducting(QObject):
    """Between the protocol's form, its run, its prompts and the panel.

    Args:
        set_up: called with the set-up that the protocol has come to. refresh: called when it is over.
    """

    def __init__(
        self,
        desk: Desk,
        recording: Recording,
        panel: Panel,
        prompt: PromptBar,
        set_up: Callable[[SetUp], None],
        refresh: Callable[[], None],
    ) -> None:
        super().__init__(recording)
        self._desk, self._recording, self._panel, self._prompt = desk, recording, panel, prompt
        self._refresh = refresh
        self.running = ProtocolRun(recording)
        self.running.asked.connect(prompt.ask)
        self.running.progressed.connect(self._on_progress)
        self.running.set_up_changed.connect(set_up)
        self.running.ended.connect(self._on_ended)
        prompt.done.connect(self.running.answer)
        recording.station.stopped.connect(lambda _: prompt.hide())
        panel.motion.edited.connect(self.tell_total)
        panel.protocol.edited.connect(self.tell_total)
        desk.protocol_handed.connect(self._on_protocol_handed)
        desk.trajectory_handed.connect(self._on_trajectory_handed)
        self.tell_total()

    def start(self) -> None:
        """Take all runs of the protocol that is set."""
        panel = self._panel
        try:
            steps = panel.protocol.steps(panel.motion.settings())
        except UserError as error:
            self._desk.tell(str(error), traceback.format_exc())
            return
        if self.running.start(steps, panel.protocol.title(), panel.initial.command()):
            self._recording.station.doing = "protocol"

    def take_file(self, path: Path) -> bool:
        """A table that was dropped becomes the motion by hand; what is none is refused in a sentence."""
        motion = self._panel.motion
        try:
            read_trajectory({"kind": motion.kind_by_points, "file": str(path)}, str(path))
        except UserError as error:
            self._desk.tell(str(error), traceback.format_exc())
            return False
        motion.show_file(path)
        self._panel.by_hand.click()
        self._desk.say(f"Motion set: {path.name}")
        return True

    def tell_total(self) -> None:
        """How many runs, how long, as the forms are now."""
        form = self._panel.protocol
        try:
            form.tell_total(form.steps(self._panel.motion.settings()))
        except UserError as error:
            form.total.setText(str(error))

    def _on_progress(self, share: float, words: str, step_left_s: float, left_s: float) -> None:
        panel = self._panel
        panel.progress.show()
        panel.progress.setValue(round(1000 * share))
        step = f": {countdown(step_left_s)}" if step_left_s > 0 else ""
        panel.left.setText(f"{words[:1].upper()}{words[1:]}{step} · in all {countdown(left_s)} left")
        self._recording.station.doing = f"protocol, {words}"

    def _on_ended(self, how: str) -> None:
        self._prompt.hide()
        self._panel.progress.setValue(1000 if how == "done" else 0)
        self._panel.left.setText("All runs taken" if how == "done" else "Given up")
        self._refresh()

    def _on_protocol_handed(self, steps: Sequence[Any], title: str) -> None:
        self._panel.protocol.hand(steps, title)
        self._panel.by_protocol.click()

    def _on_trajectory_handed(self, trajectory: dict[str, Any], title: str) -> None:
        try:
            self._panel.motion.show_settings(trajectory)
        except UserError as error:
            self._desk.tell(str(error))
            return
        self._panel.by_hand.click()
        self._desk.say(f"Motion set: {title or self._panel.motion.words()}")


def left_of_run(status: Status, rate_hz: float, lasts_s: float) -> float:
    """What is left of the trajectory that runs and lasts so long, s."""
    return max(lasts_s - (status.index - status.run_start) / rate_hz, 0.0)

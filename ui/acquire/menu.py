"""The entries of the Acquire menu, with their keys."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..tab import SEPARATOR, Command
from .panel import Panel
from .plots import LivePlots
from .prompt_bar import PromptBar
from .recording import Recording
from .toolbar import Toolbar



def acquire_menu(
    panel: Panel,
    bar: Toolbar,
    plots: LivePlots,
    prompt: PromptBar,
    recording: Recording,
    take_moment: Callable[[], Any],
    disconnect: Callable[[], Any],
) -> tuple[Command, ...]:
    """All that can be done on the tab; a key does what its button does."""

    def connected() -> bool:
        return recording.station.bench is not None

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

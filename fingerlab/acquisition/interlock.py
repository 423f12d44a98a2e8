"""The bench's digital inputs as events of the state machine, and when an enabled amplifier has current.

Pure: it counts samples and holds no device. What an event does is the state machine's to decide; what follows
from it is the loop's.
"""

from __future__ import annotations

from fingerlab.acquisition.checks import Reading
from fingerlab.acquisition.machine import Event
from fingerlab.rig.daq import SafetyLines

CHARGE_COMMANDS = 4
"""Commands after enable until the charge pump of a dead-man is full: two edges that feed it (assumed)."""

PRESSED = "The emergency stop was pressed; release it at its button, then reset, initialise and enable."
NOT_READY = (
    "The amplifier is no longer ready; look at its supply, its fault light and the emergency stop, then "
    "reset."
)
NEVER_READY = (
    "The amplifier was not ready {ms:.3g} ms after it was enabled; look at its supply, its fault light and "
    "the dead-man, then reset."
)


class Interlock:
    """Follows the digital inputs of a bench.

    Args:
        lines: which it has. period: of a sample, s. hold: samples for which the device holds a set value.

    Attributes:
        settling: the amplifier was enabled and need not be ready yet; no motion begins.
    """

    def __init__(self, lines: SafetyLines, period: float, hold: int) -> None:
        self._ready_line = lines.amplifier_ready
        self._charge = CHARGE_COMMANDS * hold if lines.dead_man.terminal else 0
        self._patience = max(round(lines.amplifier_ready.settling_time / period), self._charge)
        self._pressed = self._unready = self.settling = False
        self._enabled_at = 0

    def enabled(self, index: int) -> None:
        """The enable line went up at sample ``index``."""
        self._enabled_at = index
        self.settling = bool(self._charge or self._ready_line.terminal)

    def look(self, reading: Reading, enabled: bool) -> tuple[Event, str] | None:
        """What has changed at the inputs, with why the motor may not go on, or an empty text.

        Args:
            enabled: whether the enable line is up.
        """
        stop, ready = reading.lines
        if (stop == 1.0) is not self._pressed:
            self._pressed = not self._pressed
            return (Event.PRESS, PRESSED) if self._pressed else (Event.LET_GO, "")
        if enabled:
            return self._driving(ready == 0.0, reading.index - self._enabled_at)
        self.settling = False
        # Where only an enabled amplifier tells, "not ready" means nothing here.
        return self._readiness(ready == 0.0 and not self._ready_line.needs_enable, "")

    def _driving(self, unready: bool, since: int) -> tuple[Event, str] | None:
        if not self.settling:
            return self._readiness(unready, NOT_READY)
        if unready and since >= self._patience:
            return self._readiness(True, NEVER_READY.format(ms=1e3 * self._ready_line.settling_time))
        if not unready and since >= self._charge:
            self.settling = False
        return None

    def _readiness(self, unready: bool, sentence: str) -> tuple[Event, str] | None:
        if unready is self._unready:
            return None
        self._unready = unready
        return (Event.UNREADY, sentence) if unready else (Event.READY, "")

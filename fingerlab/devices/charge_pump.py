"""The charge pump behind a dead-man's line, as the simulated rig has it: "A dead-man" in ``docs/rig.md``.

Each rising edge moves charge from the coupling to the storage capacitor, which a resistor empties;
a comparator lets the amplifier's enable through while there is enough. A line that stands still, high or low,
moves nothing.
"""

from __future__ import annotations

import math

COUPLING = 470e-9
STORAGE = 47e-9
"""F; capacitors of the circuit in ``docs/rig.md`` (assumed: a choice of this design)."""

THRESHOLD = 0.3
"""Voltage at which the comparator lets go, as a share of the highest (assumed: a choice of this design)."""

SHARE = COUPLING / (COUPLING + STORAGE)
"""How much of what is missing one rising edge brings: 0.91."""


class ChargePump:
    """Its voltage as a share of the highest, from the line's edges and the time between them.

    Args:
        hold_time: s from the last rising edge of a full pump until it lets go.
    """

    def __init__(self, hold_time: float) -> None:
        self.time_constant = hold_time / math.log(1.0 / THRESHOLD)
        self._level = 0.0
        self._line = False

    @property
    def on(self) -> bool:
        """Whether the amplifier's enable is let through."""
        return self._level > THRESHOLD

    def invert(self) -> None:
        """One edge of the line."""
        self._line = not self._line
        if self._line:
            self._level += SHARE * (1.0 - self._level)

    def wait(self, seconds: float) -> None:
        """Let time pass without an edge."""
        self._level *= math.exp(-seconds / self.time_constant)

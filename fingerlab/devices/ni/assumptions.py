"""What this package assumes about the card and nobody has yet seen on the bench.

The code names the assumption where it relies on it; ``fingerlab check-rig`` measures each on the real card.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Assumption:
    """One statement about the card, and what happens to the bench where it is wrong."""

    id: str
    text: str
    otherwise: str


PACED_BY_THE_CARD = Assumption(
    "paced-by-the-card",
    "A blocking read in hardware-timed single-point mode returns once a cycle, at the card's sample clock.",
    "Set timing = 'buffered' in the rig file's [daq]; the position loop then runs at 100 to 200 Hz.",
)
LATE_WRITE_IS_LOST = Assumption(
    "late-write-is-lost",
    "A write to a clock-timed output never reaches the terminal once its clock has stopped, and the output "
    "may hold its last value when its task ends.",
    "The stop does not rely on it; the finding is only noted.",
)
FRESH_TASK_REACHES_THE_OUTPUT = Assumption(
    "fresh-task-reaches-the-output",
    "A fresh on-demand task brings the output to 0 V and the enable line low in whatever state the timed "
    "tasks were left.",
    "Do not drive the motor from this card; the stop would not stop it.",
)
ASSUMPTIONS = (PACED_BY_THE_CARD, LATE_WRITE_IS_LOST, FRESH_TASK_REACHES_THE_OUTPUT)

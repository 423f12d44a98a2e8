"""A rig file with a dead-man, an emergency stop and an amplifier that says whether it is ready."""

from __future__ import annotations

from fingerlab.rig.daq import plain_section
from fingerlab.rig.file import Rig, parse_rig

DEAD_MAN, STOP, READY = "port0/line1", "port0/line2", "port0/line3"
WIRED = f"""
[daq.dead_man]
terminal = "{DEAD_MAN}"
hold_time = {{ value = 50, unit = "ms", source = "assumed" }}

[daq.emergency_stop]
terminal = "{STOP}"

[daq.amplifier_ready]
terminal = "{READY}"
"""


def wired(rig: Rig, text: str = WIRED) -> Rig:
    """``rig`` with these lines in place of its own wiring."""
    daq = parse_rig(text, "the test's rig").daq
    return Rig(rig.finger, rig.motor, rig.tolerance, {**rig.extra, "daq": plain_section(daq)})

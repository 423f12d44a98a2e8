"""The steps that ask for the limits, drive the motor under them, and stop it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fingerlab.acquisition.check_rig.look import (
    CONFIRMED,
    FAILED,
    SKIPPED,
    TEST_CURRENT,
    YES,
    Driven,
    Look,
    Outcome,
    asked,
)
from fingerlab.acquisition.control.commands import Release, Reset
from fingerlab.acquisition.control.machine import Mode
from fingerlab.rig.constants import Rig
from fingerlab.rig.daq import BENCH_LIMITS, LIMIT_UNITS

RISE_SECONDS = 0.1
MOST_SECONDS = 1.0
STEADY = ((0.0, TEST_CURRENT), (MOST_SECONDS, TEST_CURRENT))
TEST_TRAVEL = math.radians(45.0)
"""Where the test ends; a motor at 13 rad/s turns some 20 degrees further until it is told."""
LEAST_TRAVEL = math.radians(1.0)
"""Less is no motion: play of the gearbox (assumed)."""
CURRENT_TOLERANCE = 0.2
"""Share by which the monitor may differ from the command: the data sheet says "about 0.8 V/A"."""
WHOLE = 0.9
"""From this share on the test current counts as reached; in its rise the monitor lags behind (assumed)."""
STOP_SECONDS = 1.0
"""A stop that the loop has not answered after this is none."""

DISABLED, DIRECTION, MONITOR = "drive/disabled", "drive/direction", "drive/monitor"
DRIVE_TITLES = {
    DISABLED: "No current without enable",
    DIRECTION: "Positive set value winds the cable",
    MONITOR: "Current monitor against set value",
}


def limits(look: Look) -> Iterator[Outcome]:
    """Every limit of the rig file, one by one."""
    held = look.rig.limits
    for name in BENCH_LIMITS:
        unit = LIMIT_UNITS[name]
        value = getattr(held, name)
        in_degrees = unit.startswith("rad")
        number, degrees = math.degrees(value) if in_degrees else value, unit.replace("rad", "°")
        shown = f"{number:.4g}{'' if degrees == '°' else ' '}{degrees}"
        called = name.replace("_", " ").replace("mcp", "MCP angle").replace("pip", "PIP angle")
        source = held.sources.get(name, "FingerLab's default")
        question = f"The limit {called} is {shown} ({source}). Is it right for this bench?"
        yield asked(look, f"limits/{name}", f"Limit {called}", question, {"value": value})


def drive(look: Look) -> Iterator[Outcome]:
    """No current without enable; with it the current, the monitor and the motion have one sign."""
    if not look.rig.daq.current_monitor.terminal:
        why = "The rig file has no current monitor, without which the loop drives no motor; connect one."
        yield from (Outcome(step, title, SKIPPED, why) for step, title in DRIVE_TITLES.items())
        return
    question = (
        "Switch the amplifier's power on, take the cable off the pulley and keep hands away: the motor will "
        f"turn with at most {TEST_CURRENT:g} A for at most {MOST_SECONDS:g} s. May it?"
    )
    answer = look.operator.ask("drive", question)
    if answer != YES:
        for step, title in DRIVE_TITLES.items():
            yield Outcome(step, title, SKIPPED, "The operator left it out.", question, answer)
        return
    disabled = _judge_disabled(look, _turn(look, line=False), question)
    yield disabled
    if disabled.open:
        for step in (DIRECTION, MONITOR):
            why = f"Left out, for {DISABLED} failed; mend that and run check-rig again."
            yield Outcome(step, DRIVE_TITLES[step], SKIPPED, why, question, answer)
        return
    yield from _judge_drive(_turn(look, line=True), question)


def stop(look: Look) -> Iterator[Outcome]:
    """The latched stop: the device confirms 0 V and a low enable line, and the operator sees it."""
    bench = look.bench
    bench.stop()
    look.until(lambda: bench.status().latched, STOP_SECONDS, "The stop")
    safe = bench.status().safe_confirmed
    title = "Stop"
    if not safe:
        yield Outcome("stop", title, FAILED, "The device does not confirm 0 V and a low enable line.")
    else:
        question = "The device confirms 0 V and a low enable line. Is the amplifier's enable light off?"
        yield asked(look, "stop", title, question, {"confirmed_by_device": safe})
    look.ask(Release())


def test_travel(rig: Rig) -> float:
    """Angle (rad) after which the current is switched off: well within what the loop lets pass."""
    return min(TEST_TRAVEL, 0.9 * rig.limits.position_high)


def _turn(look: Look, line: bool) -> Driven:
    driven = look.drive(STEADY, RISE_SECONDS, test_travel(look.rig), line)
    if look.bench.status().mode is Mode.FAULT:
        look.ask(Reset())
    return driven


def _judge_disabled(look: Look, driven: Driven, question: str) -> Outcome:
    title = DRIVE_TITLES[DISABLED]
    asked_for = _mean_under_current(driven, "current_command")
    current = _mean_under_current(driven, "motor_current")
    travel = float(np.ptp(driven.column("motor_position"))) if len(driven.rows) else math.nan
    measured = {"current": current, "commanded": asked_for, "travel": travel}
    if abs(current) > 0.25 * TEST_CURRENT or travel > LEAST_TRAVEL:
        state = FAILED
        sentence = (
            f"With the enable line low {current:.2f} A flowed and the motor turned by "
            f"{math.degrees(travel):.1f}°; check the enable line's terminal and active_high in the rig "
            "file's [daq]."
        )
    elif driven.fault or math.isnan(current + travel):
        state, sentence = FAILED, f"The loop broke the test off: {driven.fault}"
    else:
        state, sentence = CONFIRMED, "Nothing moved."
    return Outcome(DISABLED, title, state, sentence, question, YES, measured)


def _judge_drive(driven: Driven, question: str) -> Iterator[Outcome]:
    position = driven.column("motor_position")
    travel = float(position[-1] - position[0]) if len(position) else math.nan
    measured: dict[str, float] = {"travel": travel}
    if travel < -LEAST_TRAVEL:
        state = FAILED
        sentence = "The pulley turned backwards: turn the command's sign in the rig file's [daq] around."
    elif not travel > LEAST_TRAVEL:
        state = FAILED
        sentence = "The pulley did not turn; check power, enable line and the set value's terminal."
    elif driven.fault:
        state, sentence = FAILED, f"The loop stopped the motor: {driven.fault}"
    else:
        state = CONFIRMED
        sentence = f"The pulley turned by {math.degrees(travel):.0f}° in the winding direction."
    yield Outcome(DIRECTION, DRIVE_TITLES[DIRECTION], state, sentence, question, YES, measured)
    current = _mean_under_current(driven, "motor_current")
    wanted = _mean_under_current(driven, "current_command")
    measured = {"current": current, "commanded": wanted}
    share, shown = current / wanted, f"It shows {current:.2f} A of {wanted:.2f} A"
    if math.isnan(share):
        state, sentence = FAILED, "It was not seen: the motor was stopped before its current was reached."
    elif abs(share - 1.0) <= CURRENT_TOLERANCE:
        state, sentence = CONFIRMED, f"{shown}."
    elif abs(share + 1.0) <= CURRENT_TOLERANCE:
        state, sentence = FAILED, f"{shown}: turn the monitor's sign in the rig file's [daq] around."
    else:
        state = FAILED
        sentence = (
            f"{shown}; correct the gain of the command or of the monitor in the rig file's [daq], by the "
            "amplifier's settings."
        )
    yield Outcome(MONITOR, DRIVE_TITLES[MONITOR], state, sentence, question, YES, measured)


def _mean_under_current(driven: Driven, name: str) -> float:
    """Mean of a column while the whole test current was asked for; NaN where it never was."""
    under = driven.column("current_command") >= WHOLE * TEST_CURRENT
    return float(driven.column(name)[under].mean()) if under.any() else math.nan

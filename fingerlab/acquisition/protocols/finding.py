"""Finds where the cable begins to pull, and where the fingertip presses the load cell, on any bench."""

from __future__ import annotations

import math
from collections.abc import Callable

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.bench.steering import check_press
from fingerlab.acquisition.control.machine import Approach, Command, Disable, Enable, Initialise, Jog, TakeUp
from fingerlab.acquisition.protocols.steps import APPROACH_LIMIT, APPROACH_SPEED, SETTLE_S
from fingerlab.acquisition.ring import COLUMN
from fingerlab.acquisition.status import Slot
from fingerlab.core.errors import UserError

LET_GO, LET_GO_SPEED = math.radians(2.0), math.radians(4.0)
"""rad, rad/s: by how much a cable that is tight is let go again (assumed: twice what moved the joints)."""

PATIENCE_S = 5.0
"""Longer than a slow motion may take: its soft beginning, and that the cable gives (assumed)."""

SLACK_SHARE = 0.5
"""Of the way within which a finger has to follow (``follow_travel``); with more slack the motor's reference
goes to where the cable pulls (assumed: the rest of that way is left to what a cable gives before the joints
or the load cell show it)."""

FINDING = "Finding the load cell"
TAKING_UP = "Taking up the slack"

Until = Callable[[Callable[[], bool], float, str], None]
"""Waits for a condition, s at most, with words for what did not come; as :meth:`Bench.wait_until`."""


def take_up_slack(bench: Bench, initial: Initialise) -> float:
    """Wind until the cable pulls at the joints, and make that the motor's reference; then amplifier off.

    The bench was initialised. Before the current ends the cable is let go by 2 degrees, or the springs would
    throw the motor back. The encoder stands at ``initial.position`` where the joints begin to move.

    Returns:
        The slack that was taken up, rad.

    Raises:
        UserError: it was refused or stopped, or the joints did not move.
    """
    bench.ask(Enable())
    command = TakeUp()
    try:
        begin = _position(bench)
        taut = _wound(bench, command, command.limit / command.speed, TAKING_UP, bench.wait_until)
        if taut is None:
            raise UserError(
                f"The joints do not move within {math.degrees(command.limit):g}° and {command.current:g} A; "
                "fix the cable, and look whether the finger is free."
            )
        _make_reference(bench, taut, initial, bench.wait_until)
    finally:
        if bench.status().enabled:
            bench.ask(Disable())
    return taut - begin


def find_contact(
    bench: Bench, force: float, until: Until | None = None, ending: Callable[[], bool] = lambda: False
) -> float | None:
    """Take slack up with little current, wind until the load cell shows ``force`` (N), and stay there.

    Where there is more slack than a finger may lag behind, the motor's reference goes to where the cable
    pulls, so that every run begins there; angles of the joints and the load cell's zero stay as they are.

    Args:
        until: waits; else the bench does. ending: whether it is to be left, asked while it waits.

    Returns:
        The motor's angle there, rad; None where it was left.

    Raises:
        UserError: it was refused or stopped, or the finger does not reach the load cell.
    """
    check_press(force, bench.settings.limits)  # before the slack is taken up
    given = until or bench.wait_until

    def wait(condition: Callable[[], bool], seconds: float, words: str) -> None:
        given(lambda: condition() or ending(), seconds, words)

    def wound(command: TakeUp | Approach, words: str) -> float | None:
        return _wound(bench, command, command.limit / command.speed, words, wait)

    begin, slack = _position(bench), TakeUp(or_held=True)
    taut = wound(slack, TAKING_UP)
    if ending():
        return None
    if taut is None:
        raise UserError(
            f"Neither the joints nor the load cell answer within {math.degrees(slack.limit):g}° at the "
            f"pulley and {slack.current:g} A; fix the cable, and look whether the sensors have their supply."
        )
    if taut - begin > SLACK_SHARE * bench.settings.limits.follow_travel:
        _make_reference(bench, taut, Initialise(), wait, ending)
        if ending():
            return None
        bench.ask(Enable())
    reached = wound(Approach(force, APPROACH_SPEED, APPROACH_LIMIT), FINDING)
    if reached is None and not ending():
        raise UserError(
            f"The fingertip does not press the load cell with {force:g} N before "
            f"{math.degrees(APPROACH_LIMIT):g}° at the pulley; move the load cell nearer."
        )
    return reached


def _wound(bench: Bench, command: Command, seconds: float, words: str, until: Until) -> float | None:
    """Where a slow motion that takes ``seconds`` at most ended, rad; None: it found nothing."""
    bench.ask(command)
    until(lambda: bench.approached() is not None, seconds + PATIENCE_S, words)
    reached = bench.approached()
    return None if reached is None or math.isnan(reached) else reached


def _make_reference(
    bench: Bench, taut: float, initial: Initialise, until: Until, ending: Callable[[], bool] = lambda: False
) -> None:
    """Let the cable go, switch off, and take what was ``taut`` (rad) as the motor's ``initial.position``."""

    def rest() -> None:
        end = bench.board[Slot.INDEX] + SETTLE_S * bench.rate_hz
        until(lambda: bench.board[Slot.INDEX] >= end, math.inf, "")

    bench.ask(Jog(-LET_GO_SPEED))
    until(lambda: _position(bench) < taut - LET_GO, PATIENCE_S, "Letting the cable go")
    if ending():
        return
    bench.ask(Jog(0.0))
    rest()
    if ending():
        return
    bench.ask(Disable())
    rest()
    back = _position(bench) - taut
    bench.ask(Initialise(initial.position + back, initial.mcp, initial.pip))


def _position(bench: Bench) -> float:
    return float(bench.ring.last(1)[0, COLUMN["motor_position"]])

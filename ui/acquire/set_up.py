"""What is on the bench: phase, cable and known load go together, and a load is lifted before it is moved."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from fingerlab.acquisition.bench import Bench
from fingerlab.acquisition.commands import Finish, SetUp, Start
from fingerlab.acquisition.protocol import LIFT_S, Lift, lifting, plan_steps
from fingerlab.core.errors import UserError

LOADED_PHASE = "motor_bench"
"""The phase that can have a known load."""


def changed_set_up(before: SetUp, **values: Any) -> SetUp:
    """A set-up whose cable goes with its phase, without a load where none can hang.

    Raises:
        UserError: phase and cable do not go together.
    """
    from fingerlab.twin.protocols import setup_of

    wanted = replace(before, **values)
    if "cable" not in values and "phase" in values:
        phase, cable = setup_of(wanted.phase)
    else:
        phase, cable = setup_of(wanted.phase, wanted.cable)
    load = wanted.load_torque if phase == LOADED_PHASE else 0.0
    return SetUp(phase, cable, load)


def lift_before(set_up: SetUp, trajectory: Mapping[str, Any]) -> Lift | None:
    """How a run's known load is lifted off its support before the run, as in a protocol; None without one.

    Raises:
        UserError: the run would set the load down, or is no trajectory.
    """
    if not set_up.load_torque:
        return None
    from fingerlab.twin.protocols import RunPlan

    plan = RunPlan(set_up.phase, set_up.cable, trajectory, set_up.load_torque)
    return next((step for step in plan_steps([plan], 0.0) if isinstance(step, Lift)), None)


def lift_and_start(lift: Lift, start: Start) -> Callable[[Bench], None]:
    """Lifts the load, then starts; a start that is refused sets it down again."""

    def work(bench: Bench) -> None:
        bench.ask(lifting(lift))
        bench.wait(LIFT_S)
        try:
            bench.ask(start)
        except UserError:
            with suppress(UserError):  # stopped meanwhile: the first sentence says it
                bench.ask(Finish())
            raise

    return work

"""Which runs a session holds: the thesis' protocol and richer ones."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.core.errors import UserError
from fingerlab.rig.constants import read_intervention
from fingerlab.sessions.format import CABLES

RATE_HZ = 1000.0
"""Control loop and recording, thesis section 3.2."""

THESIS_RUNS = 10
THESIS_SECONDS = 30.0


@dataclass(frozen=True)
class RunPlan:
    """One run to take.

    Attributes:
        phase, cable: as in the session format.
        trajectory: JSON object; in contact its ``offset_deg`` is found by the operator's approach
            where it is absent.
        load_torque: N m, constant known load in place of the finger (motor bench).
    """

    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    load_torque: float = 0.0
    attributes: Mapping[str, Any] = field(default_factory=dict)


def _wave(kind: str, amplitude: float, frequency: float, offset: float | None, **more: Any) -> dict[str, Any]:
    wave = {"kind": kind, "amplitude_deg": amplitude, "frequency_hz": frequency, **more}
    if offset is not None:
        wave["offset_deg"] = offset
    return wave


def _thesis(contact_amplitude: float) -> list[RunPlan]:
    """Ten on-air runs with the extension cable, ten contact runs with the flexion cable, 30 s each."""
    free = _wave("sine", 15.0, 1.0, 22.0, duration_s=THESIS_SECONDS)
    press = _wave("sine", contact_amplitude, 1.0, None, duration_s=THESIS_SECONDS)
    return [RunPlan("on_air", "extension", free)] * THESIS_RUNS + [
        RunPlan("contact", "flexion", press)
    ] * THESIS_RUNS


def _on_air(contact_amplitude: float) -> list[RunPlan]:
    """Eight runs with the extension cable, two with the flexion cable, 20 s each."""
    extension = (
        _wave("sine", 15.0, 1.0, 22.0),
        _wave("sine", 11.0, 0.4, 22.0),
        _wave("sine", 11.0, 1.9, 22.0),
        _wave("chirp", 11.0, 0.5, 22.0, end_frequency_hz=3.0),
        _wave("chirp", 14.0, 0.4, 22.0, end_frequency_hz=2.2),
        _wave("multisine", 17.0, 1.0, 23.0),
        _wave("multisine", 14.0, 1.0, 25.0, frequencies_hz=[0.4, 0.9, 1.5, 2.3]),
        _wave("steps", 14.0, 0.5, 22.0, seed=1),
    )
    flexion = (_wave("sine", 9.0, 1.0, 15.0), _wave("chirp", 8.0, 0.5, 15.0, end_frequency_hz=3.0))
    return [RunPlan("on_air", "extension", w) for w in extension] + [
        RunPlan("on_air", "flexion", w) for w in flexion
    ]


def _contact(contact_amplitude: float) -> list[RunPlan]:
    """Four contact runs with the flexion cable, 20 s each."""
    return [RunPlan("contact", "flexion", _wave("sine", contact_amplitude, 1.0, None))] * 4


def _rich(contact_amplitude: float) -> list[RunPlan]:
    """Ten runs on air with either cable and four in contact, 20 s each."""
    return _on_air(contact_amplitude) + _contact(contact_amplitude)


def _motor_bench(contact_amplitude: float) -> list[RunPlan]:
    """The motor alone and against two constant loads, 20 s each."""
    waves = (
        _wave("sine", 60.0, 0.5, 70.0),
        _wave("ramp_hold", 70.0, 0.2, 80.0),
        _wave("chirp", 25.0, 0.3, 40.0, end_frequency_hz=4.0),
    )
    return [RunPlan("motor_bench", "none", wave, load) for load in (0.0, 0.04, 0.09) for wave in waves]


PROTOCOLS: dict[str, Callable[[float], list[RunPlan]]] = {
    "on-air": _on_air,
    "contact": _contact,
    "motor-bench": _motor_bench,
    "thesis": _thesis,
    "rich": _rich,
}
"""Protocols of ``simulate``: name -> plan, given the contact amplitude in degrees at the pulley."""

CABLE_OF_PHASE = {"on_air": "extension", "contact": "flexion", "motor_bench": "none", "free": "extension"}


def setup_of(phase: str, cable: str | None = None) -> tuple[str, str]:
    """Phase and cable of a set-up; the phase's usual cable where none is given.

    Raises:
        UserError: the phase or cable is unknown, or they do not go together.
    """
    if phase not in CABLE_OF_PHASE:
        raise UserError(f"The phase is {phase!r}; it should be one of {', '.join(CABLE_OF_PHASE)}.")
    cable = cable or CABLE_OF_PHASE[phase]
    if cable not in CABLES:
        raise UserError(f"The cable is {cable!r}; it should be one of {', '.join(CABLES)}.")
    if (cable == "none") != (phase == "motor_bench"):
        raise UserError(f"The phase {phase} and the cable {cable!r} do not go together.")
    if phase == "contact" and cable != "flexion":
        raise UserError(
            "A contact run presses with the flexion cable; leave the cable out or give 'flexion'."
        )
    return phase, cable


def single_run(
    trajectory: str | Mapping[str, Any],
    phase: str,
    cable: str | None = None,
    intervention: Mapping[str, Any] | None = None,
) -> RunPlan:
    """One proposed run, as in ``next_experiment`` of a diagnosis.

    Args:
        trajectory: JSON text or object; for a motor bench maybe with ``load_torque``, N m.
        intervention: a known change of the machine, as in ``rig.intervention``.

    Raises:
        UserError: the phase or cable is unknown, or they do not go together, or the trajectory or the change
            is bad.
    """
    phase, cable = setup_of(phase, cable)
    change = read_intervention(intervention or {}, "The proposed 'intervention'")
    if change.to_json() and cable == "none":
        raise UserError("A known change is one of the finger's bench; leave it out for the motor alone.")
    settings = dict(read_trajectory(trajectory).settings)
    load = settings.get("load_torque", 0.0)
    if isinstance(load, bool) or not isinstance(load, int | float) or not math.isfinite(load):
        raise UserError(f"The trajectory has 'load_torque' = {load!r}; it should be a torque in N m.")
    if load and phase != "motor_bench":
        raise UserError(
            f"The trajectory has a 'load_torque', and the phase is {phase}; a known load goes with "
            "motor_bench."
        )
    if settings["kind"] in ("file", "torque"):  # the points stay with the plan, however many they are
        settings = dict(json.loads(trajectory) if isinstance(trajectory, str) else trajectory)
    settings.pop("load_torque", None)
    return RunPlan(phase, cable, settings, float(load), change.attributes())

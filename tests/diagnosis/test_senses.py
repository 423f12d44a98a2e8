"""A channel whose sense or unit is not the format's is told in a sentence; it is no missing effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from fingerlab.core.errors import UserError
from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.effects import CATALOGUE
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Array, Run, Session

OTHER = {"extension": "flexion", "flexion": "extension"}


Samples = list[dict[str, Array]]


@pytest.fixture(scope="module")
def plain(shared_data: Path) -> tuple[Session, Samples]:
    """The recording that the tests change, and the samples of every run: unpacking them takes longest."""
    session = open_session(shared_data / "bench-plain.h5")
    return session, [run.load() for run in session.runs]


def changed(
    session: Session, loaded: Samples, factors: Mapping[str, float], other_cable: bool = False
) -> Session:
    """The session with some channels multiplied, and maybe with the cables' names exchanged."""
    runs = [
        Run.from_arrays(
            {name: factors.get(name, 1.0) * values for name, values in samples.items()},
            name=run.name,
            phase=run.phase,
            cable=OTHER[run.cable] if other_cable else run.cable,
            sample_rate_hz=run.sample_rate_hz,
            trajectory=run.trajectory,
        )
        for run, samples in zip(session.runs, loaded, strict=True)
    ]
    return replace(session, runs=tuple(runs))


@pytest.mark.parametrize(
    ("factors", "other_cable", "sentence"),
    [
        ({"mcp_angle": -1.0}, False, "The MCP angle turns against the cable .* turn its sign"),
        ({"pip_angle": -1.0}, False, "The PIP angle turns against the cable .* turn its sign"),
        ({"motor_position": -1.0}, False, "'motor_position' turns against its command in every run"),
        (
            {"motor_position": -1.0, "motor_command": -1.0},
            False,
            "Both joints turn against the cable .* turn the sign of motor_position",
        ),
        ({}, True, "Both joints turn against the cable .* name the other cable"),
        (
            {"motor_torque": -1.0},
            False,
            "'motor_torque' is -1 times what motor_current .* make it .* turn its sign",
        ),
        (
            {"motor_torque": -1.0, "motor_current": -1.0},
            False,
            r"would push the cable .* \(run 001: -2\.\d+ N on average\)",
        ),
        ({"motor_torque": 0.0}, False, "'motor_torque' never changes"),
        ({"pip_angle": 57.3}, False, "channel 'pip_angle' goes to .* write it in rad, not in degrees"),
    ],
)
def test_a_turned_channel_is_told(
    plain: tuple[Session, Samples], factors: Mapping[str, float], other_cable: bool, sentence: str
) -> None:
    session = changed(*plain, factors, other_cable)
    with pytest.raises(UserError, match=sentence):
        Reduction([session]).of([CATALOGUE["viscous_friction"]])
    if factors == {"motor_torque": -1.0, "motor_current": -1.0}:  # refused last, and so in every diagnosis
        with pytest.raises(UserError, match=sentence):
            diagnose([session], with_curves=False)


@pytest.mark.parametrize("name", ["bench-slack", "bench-delay", "sealed-4", "bench-thesis-protocol"])
def test_what_physics_does_to_a_channel_is_let_pass(shared_data: Path, name: str) -> None:
    """A cable that hangs loose, an angle that comes late, a joint at its stop, friction in the sheath.

    Channels are judged while they are read: what is refused is refused there, as above.
    """
    reduced = Reduction([open_session(shared_data / f"{name}.h5")]).of([CATALOGUE["viscous_friction"]])
    assert sum(group.samples for group in reduced.groups) > 5_000

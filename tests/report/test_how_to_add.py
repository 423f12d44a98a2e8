"""The command that takes the error path, in words."""

from __future__ import annotations

from dataclasses import replace

from fingerlab.diagnosis.answer.results import Diagnosis, PathStep
from fingerlab.report.score_words import how_to_add
from tests.ui import invented


def along(*steps: tuple[str, float], model: tuple[str, ...] = ()) -> Diagnosis:
    """Coulomb friction is likeliest, alone leaves 1.1, and the path has these steps from 12.4."""
    found = invented.nominal_diagnosis("s.h5")
    path = (PathStep(None, 12.4), *(PathStep(name, score) for name, score in steps))
    return replace(found, path=path, model=model, set=("coulomb_friction",))


def test_all_of_the_path_is_one_command() -> None:
    assert how_to_add(along(("coulomb_friction", 1.1))) == "To put it into the model: --add coulomb_friction"
    both = along(("coulomb_friction", 1.1), ("cable_stretch", 1.02), model=("gravity_tilt",))
    assert how_to_add(both) == (
        "To put them into the model: --add gravity_tilt --add coulomb_friction --add cable_stretch"
    )
    assert how_to_add(along()) == ""


def test_where_the_path_begins_otherwise_than_the_verdict_it_is_said_why() -> None:
    said = how_to_add(along(("motor_coulomb_friction", 2.5), ("cable_stretch", 1.02)))
    both = "Coulomb friction in motor and gearbox and cable stretch together leave 1.02"
    assert said == (
        "The path begins with Coulomb friction in motor and gearbox, although Coulomb joint friction is "
        f"likelier as the one effect: {both}, Coulomb joint friction alone 1.10. To put them into the model: "
        "--add motor_coulomb_friction --add cable_stretch. For that one: --add coulomb_friction"
    )
    behind = how_to_add(along(("cable_stretch", 6.0), ("coulomb_friction", 1.02)))
    assert behind.endswith("--add cable_stretch --add coulomb_friction")
    assert behind.startswith(
        "The path begins with cable stretch, although Coulomb joint friction is likelier"
    )

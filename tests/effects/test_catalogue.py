"""The catalogue as a whole: its names, and that every effect says what it must."""

from __future__ import annotations

import ast
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.effects import CATALOGUE, effect
from fingerlab.effects.base import COORDINATE_UNITS, Row
from fingerlab.twin.effects import EFFECTS as PLANT_EFFECTS

from .moving import bench, moving

ROOT = Path(__file__).parents[2]
FAMILIES = {"joint_torque", "cable_kinematics", "motor_torque", "endpoint_force"}
SI_UNITS = {
    "1", "tan", "rad", "rad/s", "1/rad", "s", "m", "m/N", "m s/N", "kg", "kg m^2", "N m", "N m/rad",
    "N m/rad^2", "N m/rad^3", "1/rad^2", "N m s/rad", "N m s/rad^2", "N m s^2/rad^2",
}  # fmt: skip
OF_FINGER = sorted(CATALOGUE)
OF_BENCH = sorted(name for name, e in CATALOGUE.items() if e.bench is True)


def test_ids_are_those_of_the_contract() -> None:
    contract = ROOT.parent / "shared" / "contracts" / "effects.md"
    if not contract.is_file():
        pytest.skip(f"the contract is not at {contract}")
    ids = re.findall(r"^\| ([a-z_]+) \|", contract.read_text(encoding="utf-8"), re.MULTILINE)
    assert set(CATALOGUE) == set(ids) - {"id"}


def test_ids_are_those_of_the_simulated_bench() -> None:
    assert set(CATALOGUE) == set(PLANT_EFFECTS)


@pytest.mark.parametrize(("room", "other"), [("effects", "twin"), ("twin", "effects")])
def test_what_is_put_in_and_what_is_looked_for_do_not_know_each_other(room: str, other: str) -> None:
    """A blind trial is one only while the simulated bench shares no law of an effect with the diagnosis."""
    files = sorted((ROOT / "fingerlab" / room).rglob("*.py"))
    assert len(files) > len(CATALOGUE)
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names: list[str] = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, path
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            assert not [name for name in names if f"{name}.".startswith(f"fingerlab.{other}.")], path
            if room == "twin":  # no formula of the diagnosis either
                shared = [name for name in names if name.startswith("fingerlab.physics")]
                assert all(name.startswith("fingerlab.physics.parameter") for name in shared), path


def test_an_unknown_effect_is_told_with_the_known_ones() -> None:
    with pytest.raises(UserError, match=r"no effect 'glue'.*coulomb_friction"):
        effect("glue")


@pytest.mark.parametrize("name", OF_FINGER)
def test_every_effect_says_what_a_person_needs(name: str) -> None:
    one = CATALOGUE[name]
    assert one.id == name
    assert set(one.acts_on) <= FAMILIES
    assert one.acts_on
    assert one.title and one.title[0].isupper()  # noqa: PT018
    assert re.fullmatch(r"[A-Z].{20,}\.", one.explanation)
    assert not re.search(r"\d", one.explanation.replace("I2", "")), "numbers are added from the data"
    assert len(one.reveal) > 15
    assert one.coordinate in COORDINATE_UNITS
    assert one.equation in (Row.MCP, Row.PIP, Row.CABLE, Row.TIP)


@pytest.mark.parametrize("name", OF_FINGER)
def test_every_number_has_a_unit_a_range_and_a_source(name: str) -> None:
    one = CATALOGUE[name]
    gains = {**one.gains, **one.relaxes}
    assert gains or one.special
    for key, gain in gains.items():
        assert gain.unit in SI_UNITS, key
        assert gain.low < gain.high
        assert 0 < gain.typical <= max(abs(gain.low), gain.high), key
        assert gain.source
        assert gain.title or not one.gains, key
    # What only recordings suggest, or grid refinement tries, no point of the catalogue's grid need name.
    usual = set(one.shape_units) & set(one.shapes[0]) if one.shapes else set()
    for shape in one.shapes:
        assert usual <= set(shape)
        switches = set(shape) - set(one.shape_units)
        assert {shape[switch] for switch in switches} <= {0.0, 1.0}
    for before, after in pairwise(one.shapes):
        same_switches = all(before[k] == after[k] for k in before if k not in one.shape_units)
        # On the other side of a switch the way goes back, so that the search can cross it anywhere near.
        assert sum(before[k] != after[k] for k in usual) == 1 or not same_switches
    assert len({tuple(s.values()) for s in one.shapes}) == len(one.shapes)


@pytest.mark.parametrize("name", OF_FINGER)
@pytest.mark.parametrize("force", [None, 1.0])
def test_columns_use_the_declared_gains_and_are_finite(name: str, force: float | None) -> None:
    one, motion = CATALOGUE[name], moving(force=force)
    names = {name for name, gain in one.gains.items() if not one.special and gain.cable != "none"}
    used: set[str] = set()
    for shape in (*one.shapes, *one.closer(one.shapes[0])):  # a law of the second look may need more gains
        terms = one.columns(motion, shape)
        used |= {t.gain for t in terms} - {""}
        assert used <= names
        for term in terms:
            assert term.values.shape == motion.time.shape
            assert np.isfinite(term.values).all()
            assert term.row in (Row.MCP, Row.PIP, Row.CABLE, Row.TIP)
    assert used == names


@pytest.mark.parametrize(
    "name", [n for n in OF_FINGER if len(CATALOGUE[n].closer(CATALOGUE[n].shapes[0])) > 1]
)
def test_what_a_second_look_tries_is_the_same_effect(name: str) -> None:
    """The effect's gains on the same scales, around the shape that was found, and no shape twice."""
    one, motion = CATALOGUE[name], moving(force=1.0)
    found = one.shapes[len(one.shapes) // 2]
    closer = one.closer(found)
    scales = {t.scale for t in one.columns(motion, found)}
    for shape in closer:
        terms = one.columns(motion, shape)
        assert {t.gain for t in terms} - {""} <= set(one.gains)
        assert {t.scale for t in terms if t.gain != "loss"} <= scales
        assert all(np.isfinite(t.values).all() for t in one.columns(motion, shape))
    assert len({tuple(sorted(s.items())) for s in closer}) == len(closer)
    for unknown in (u for u in one.shape_units if u in found):
        same_law = [s for s in closer if unknown in s]  # friction by the speed has no travel
        values = [s[unknown] for s in same_law if not set(s) - set(found) or s.get("sharpness", 0.0) == 0.0]
        assert min(values) <= found[unknown] <= max(values)


@pytest.mark.parametrize("name", OF_BENCH)
def test_motor_effects_stand_in_the_bench_equation(name: str) -> None:
    one, motion = CATALOGUE[name], bench()
    # A switch that the recordings may suggest has a gain of its own.
    switched = one.gains.keys() & set(one.switches_seen)
    for shape in (*one.shapes, *({**one.shapes[0], switch: 1.0} for switch in switched)):
        terms = one.columns(motion, shape)
        assert {t.row for t in terms} == {Row.BENCH}
        assert {t.gain for t in terms} == set(one.gains) - (switched - shape.keys())


@pytest.mark.parametrize("name", OF_FINGER)
def test_the_equations_changed_are_the_equations_named(name: str) -> None:
    """Joint torques with scale of the joint, tension in both joints, length in the cable."""
    one = CATALOGUE[name]
    terms = [t for shape in one.shapes for t in one.columns(moving(force=1.0), shape)]
    joint = any(t.scale == "joint" for t in terms)
    cable = any(t.row == Row.CABLE and t.scale != "compliance" for t in terms)
    tip = any(t.row == Row.TIP for t in terms)
    drive = any(t.row in (Row.MCP, Row.PIP) and t.scale == "direct" for t in terms)
    if joint and one.acts_on != ("endpoint_force",):
        assert "joint_torque" in one.acts_on
    assert not tip or joint or "endpoint_force" in one.acts_on
    if cable:
        assert "cable_kinematics" in one.acts_on
    if drive:
        assert "motor_torque" in one.acts_on

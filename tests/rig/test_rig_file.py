"""The rig file: constants with unit, source and tolerance."""

from __future__ import annotations

import math

import pytest

from fingerlab.core.errors import UserError
from fingerlab.rig.file import CONSTANT_UNITS, Rig, default_rig, load_rig, parse_rig, sources_of

FINGER = """
[finger]
proximal_mass = { value = 12, unit = "g", source = "kitchen scale", tolerance = 0.05 }
distal_mass = 0.013
proximal_half_length = { value = 22.5, unit = "mm" }
distal_half_length = 0.024
proximal_inertia = { value = 20.25, unit = "g cm^2" }
distal_inertia = 2.5e-6
mcp_stiffness = { value = 0.002, unit = "N m/deg" }
pip_stiffness = { value = 60, unit = "mN m/rad" }
"""


def test_the_default_rig_says_where_each_constant_comes_from():
    rig = default_rig()
    assert rig.motor.torque_constant == 0.0302  # thesis table 2.3: 30.2 mN m/A
    assert rig.motor.gear_ratio == 4.3
    assert rig.motor.inertia is None  # the thesis subtracts none
    assert math.degrees(rig.finger.wrist_angle) == pytest.approx(15.0)
    assert rig.finger.gravity == 9.81
    sources = sources_of(rig)
    known = {name for name in CONSTANT_UNITS if name != "inertia"}
    assert set(sources) == known
    assert all("assumed" in s or "thesis" in s or "data sheet" in s for s in sources.values())
    assert "assumed" in sources["proximal_mass"]
    # Uniform rods: m (2 l)^2 / 12.
    finger = rig.finger
    assert finger.proximal_inertia == pytest.approx(0.012 * 0.045**2 / 12, rel=1e-3)
    assert finger.distal_inertia == pytest.approx(0.013 * 0.048**2 / 12, rel=1e-3)


def test_sources_travel_in_the_session():
    rig = default_rig()
    again = Rig.from_json(rig.to_json())
    assert again == rig
    assert sources_of(again) == sources_of(rig)


def test_units_are_converted(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(FINGER + "[motor]\npulley_radius = 0.015\n[tolerance]\ninertia = 0.2\n", encoding="utf-8")
    rig = load_rig(path)
    assert rig.finger.proximal_mass == 0.012
    assert rig.finger.proximal_half_length == 0.0225
    assert rig.finger.proximal_inertia == 2.025e-6
    assert rig.finger.mcp_stiffness == pytest.approx(0.1145916, rel=1e-6)  # 0.002 * 180 / pi
    assert rig.finger.pip_stiffness == 0.06
    assert rig.tolerance_of("proximal_mass") == 0.05
    assert rig.tolerance_of("inertia") == 0.2
    assert sources_of(rig) == {"proximal_mass": "kitchen scale"}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[finger\n", "is not TOML"),
        ("[finger]\nproximal_mass = 0.01\n", "lacks 'distal_mass'"),
        ("[motor]\ntorque = 1\n", r"\[motor\] holds the unknown 'torque'; it knows torque_constant"),
        ("[motor]\ngear_ratio = 'four'\n", "gear_ratio is 'four'; it should be a finite number"),
        ("[motor]\ngear_ratio = nan\n", "gear_ratio is nan"),
        ("[motor]\npulley_radius = {value = 1, unit = 'furlong'}\n", "in 'furlong'; it should be in 'm'"),
        ("[motor]\npulley_radius = {radius = 1}\n", "a table of value, unit, source and tolerance"),
        ("[motor]\npulley_radius = {value = 1, tolerance = -1}\n", "tolerance -1"),
        ("[tolerance]\ninertia = true\n", "is True; it should be a finite number"),
        ("motor = 3\n", r"\[motor\] is not a section"),
        ("tolerance = 3\n", r"\[tolerance\] is not a section"),
    ],
)
def test_a_bad_rig_file_is_one_sentence(text, sentence):
    with pytest.raises(UserError, match=sentence):
        parse_rig(text, "rig.toml")


def test_a_missing_rig_file(tmp_path):
    with pytest.raises(UserError, match="cannot be read"):
        load_rig(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="not text in UTF-8"):
        load_rig(tmp_path / "binary.toml")


@pytest.mark.parametrize("text", ["", "# only a remark\n", 'title = "bench"\n[tolerance]\ninertia = 0.2\n'])
def test_a_file_that_says_nothing_of_a_rig_is_refused(tmp_path, text):
    path = tmp_path / "empty.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=r"empty\.toml says nothing of a rig; it should hold .*\[motor\]"):
        load_rig(path)
    path.write_text(text + "\n[daq.dead_man]\nterminal = 'port0/line1'\n", encoding="utf-8")
    assert load_rig(path).daq.dead_man is not None  # wiring alone is a rig file

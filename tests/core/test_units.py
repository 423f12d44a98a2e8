"""Units of a person's files, against the definitions of the SI."""

from __future__ import annotations

import pytest

from fingerlab.core.text import factor, same_unit


@pytest.mark.parametrize(
    ("unit", "si", "times"),
    [
        ("deg", "rad", 0.017453292519943295),
        ("°", "rad", 0.017453292519943295),
        ("deg/s", "rad/s", 0.017453292519943295),
        ("N m/deg", "N m/rad", 57.29577951308232),
        ("g cm^2", "kg m^2", 1e-7),
        ("g mm^2", "kg m^2", 1e-9),
        ("N cm", "N m", 1e-2),
        ("min", "s", 60.0),
        ("µm", "m", 1e-6),
        ("um", "m", 1e-6),
        ("mV", "V", 1e-3),
        ("parts", "parts", 1.0),
    ],
)
def test_factors_to_si(unit: str, si: str, times: float) -> None:
    assert factor(unit, si) == pytest.approx(times, rel=1e-15)


def test_what_cannot_be_converted_is_none() -> None:
    assert factor("furlong", "m") is None
    assert factor("N", "N m") is None
    assert factor("kg", "") is None


def test_spellings_are_no_conversions() -> None:
    assert same_unit(" Nm ", "N m")
    assert same_unit("radians", "rad")
    assert not same_unit("mN m", "N m")
    assert not same_unit("deg", "rad")

"""Whether a pressing tip slides, and what of the force a tip that sticks may hold along the face.

The angles are solved from the finger's geometry for a tip whose way along the face is given.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.equations.parameters import nuisance_ranges
from fingerlab.diagnosis.signals.reading_errors import FORCE
from fingerlab.diagnosis.signals.tip_travel import tip_record, tips_stick
from fingerlab.sessions.model import Run
from tests.effects.moving import FINGER

from . import closed_form as made

RATE, SECONDS, STEP = 500.0, 10.0, np.radians(0.04)
DEPTH_M, REACH_M = -1e-3, 0.083


def along(travel_m: float) -> Run:
    """A tip at one depth whose reach goes to and fro by ``travel_m`` in all, pressed by 1 N more or less."""
    rng = np.random.default_rng(2)
    time = np.arange(int(RATE * SECONDS)) / RATE
    reach = REACH_M + 0.5 * travel_m * np.sin(2 * np.pi * time)
    proximal, distal = 2 * FINGER.proximal_half_length, 2 * FINGER.distal_half_length
    # Law of cosines: the elbow of a chain of two links that ends at (reach, depth).
    square = reach**2 + DEPTH_M**2
    elbow = np.arccos((square - proximal**2 - distal**2) / (2 * proximal * distal))
    first = np.arctan2(DEPTH_M, reach) - np.arctan2(distal * np.sin(elbow), proximal + distal * np.cos(elbow))
    angles = (first + FINGER.wrist_angle, elbow)
    read = [STEP * np.round((a + 0.5 * STEP * rng.standard_normal(len(time))) / STEP) for a in angles]
    still = np.zeros_like(time)
    channels = {
        "time": time, "motor_position": still, "motor_torque": still, "mcp_angle": read[0],
        "pip_angle": read[1], FORCE: 1.5 + np.sin(2 * np.pi * time) + 0.01 * rng.standard_normal(len(time)),
    }  # fmt: skip
    return Run.from_arrays(channels, name="001", phase="contact", cable="flexion", sample_rate_hz=RATE)


def test_the_tip_is_where_the_chain_ends() -> None:
    tip = tip_record(along(1e-3), FINGER, 0.02)
    assert tip is not None
    assert tip.depth == pytest.approx(DEPTH_M, abs=5e-5)
    assert np.ptp(tip.reach) == pytest.approx(1e-3, abs=6e-5)
    assert tip.load == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize(("travel_m", "sticks"), [(0.0, True), (1e-5, True), (1e-4, False), (5e-4, False)])
def test_a_tip_sticks_that_goes_no_further_than_it_gives(travel_m: float, sticks: bool) -> None:
    """2 N at a friction of 0.4 give 24 um; one run that slides is enough."""
    session = replace(made.session(made.Bench(), contact=0), rig=replace(made.RIG, finger=FINGER))
    assert tips_stick([(session, along(travel_m))]) is sticks
    assert not tips_stick([(session, along(travel_m)), (session, along(5e-4))])
    assert not tips_stick([])


def test_what_sticks_holds_any_share_within_its_friction() -> None:
    """A share that stays, of a tip that slides, is a force that leans; of one that sticks, its friction."""
    slides = nuisance_ranges(made.RIG)["lateral"]
    sticks = nuisance_ranges(made.RIG, tip_sticks=True)["lateral"]
    follows = nuisance_ranges(made.RIG)["lateral_slip_2"]
    assert (sticks.low, sticks.high, sticks.typical) == (follows.low, follows.high, follows.typical)
    assert slides.high < 0.5 * sticks.high

"""The command over a change of motion: it stays between both motions, whatever speed it had."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fingerlab.acquisition.control.motion import Reference
from fingerlab.acquisition.control.trajectories import read_trajectory

PERIOD = 1e-3


def sine(amplitude: float, frequency: float, offset: float = 20.0) -> dict[str, object]:
    return {
        "kind": "sine", "amplitude_deg": amplitude, "frequency_hz": frequency, "offset_deg": offset,
        "duration_s": 20.0,
    }  # fmt: skip


@pytest.mark.parametrize("after", [1900, 2150, 2400, 2650])
def test_a_change_stays_between_both_motions(after: int) -> None:
    """15 degrees at 1 Hz and 9 degrees at 1.5 Hz about 20 degrees: never outside 5 to 35 degrees."""
    reference = Reference(PERIOD)
    reference.start(read_trajectory(sine(15.0, 1.0)), 0.0, endless=True)
    for _ in range(after):
        reference.next()
    reference.change(read_trajectory(sine(9.0, 1.5)), endless=True)
    command = np.degrees([reference.next() for _ in range(4000)])
    assert command.min() >= 5.0 - 1e-6
    assert command.max() <= 35.0 + 1e-6
    assert np.ptp(command[2500:]) == pytest.approx(18.0, abs=1e-3)


def test_changes_in_quick_succession_make_no_jump_either() -> None:
    reference = Reference(PERIOD)
    reference.start(read_trajectory(sine(10.0, 0.5)), 0.0, endless=True)
    command = [reference.next() for _ in range(2000)]
    for amplitude, frequency in ((5.0, 2.0), (12.0, 1.0), (8.0, 0.7)):
        reference.change(read_trajectory(sine(amplitude, frequency)), endless=True)
        command += [reference.next() for _ in range(300)]
    steps = np.diff(command)
    # No motion accelerates by more than 12 degrees times (2 pi 2 Hz)^2, and a mixture by a few times that;
    # a jump in speed within a millisecond would be hundreds of times as much.
    assert np.abs(np.diff(steps)).max() / PERIOD**2 < 3 * math.radians(12.0) * (4 * math.pi) ** 2

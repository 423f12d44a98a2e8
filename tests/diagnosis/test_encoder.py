"""A position between the counts of its encoder, against the position that was counted."""

import numpy as np
import pytest

from fingerlab.diagnosis.signals.encoder import between_counts, smallest_step

RATE_HZ = 1000.0
TIME = np.arange(4000) / RATE_HZ


def counted(position):
    """What an encoder of one count a unit reads, at the middle of its counts."""
    return np.round(position)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize(
    ("amplitude", "hertz", "most"), [(3.3, 1.0, 0.08), (8.4, 1.0, 0.06), (20.7, 0.3, 0.06)]
)
def test_a_slow_sine_is_known_far_closer_than_a_count(amplitude, hertz, most):
    true = amplitude * np.sin(2 * np.pi * hertz * TIME)
    read = counted(true)
    found = between_counts(read, smallest_step(read), RATE_HZ)
    # A position anywhere in its count is off by a count over the square root of twelve.
    assert rms(read - true) == pytest.approx(1 / np.sqrt(12), rel=0.1)
    assert rms(found - true) < most


def test_a_parabola_turns_round_where_it_does():
    true = 0.3 + 6.0 * (TIME - 2.0) ** 2
    found = between_counts(counted(true), 1.0, RATE_HZ)
    assert found.min() == pytest.approx(0.3, abs=0.1)


def test_no_position_leaves_the_count_that_was_read():
    rng = np.random.default_rng(4)
    read = counted(np.cumsum(rng.normal(0.0, 0.2, len(TIME))))
    found = between_counts(read, smallest_step(read), RATE_HZ)
    assert np.abs(found - read).max() <= 0.5


def test_counts_that_change_with_every_sample_stay_as_read():
    read = counted(400.0 * np.sin(2 * np.pi * TIME[:200]))
    read = read[np.append(True, np.diff(read) != 0)]
    assert np.array_equal(between_counts(read, 1.0, RATE_HZ), read)


def test_a_motor_that_rests_in_a_count_is_thought_to_be_in_its_middle():
    # Five counts in a tenth of a second, a rest of three seconds, and back.
    true = np.interp(TIME, [0.0, 0.1, 3.1, 3.2], [0.0, 5.0, 5.0, 0.0])
    found = between_counts(counted(true), 1.0, RATE_HZ)
    assert found[1000:2000] == pytest.approx(5.0, abs=0.25)


def test_a_channel_without_steps_stays_as_it_is():
    smooth = np.sin(2 * np.pi * TIME)
    assert smallest_step(smooth) == 0.0
    assert between_counts(smooth, 0.0, RATE_HZ) is smooth

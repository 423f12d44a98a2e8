"""Which moments of a stretch are judged apart: those of a taut cable, and those at which the motor stands."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fingerlab.diagnosis.bandwidth import NARROW_HALF, NARROW_STEP, narrow, narrow_count
from fingerlab.diagnosis.sums import BoolArray
from fingerlab.effects.motion import Motion
from fingerlab.sessions.model import Array

SLACK_TENSION_N = 0.12
"""Below this tension the cable may be slack, N; assumed: a few times the noise of the current at 8 Hz."""
INERTIA_SPREADS = 2.0
"""... and more where the rotor speeds up: its inertia may be off by so many standard deviations."""
AT_REST_DEG = 0.1
"""A motor stands that turns by less than this in a sixth of a second; assumed: two steps of its encoder."""
REST_REACH = 2  # decimated samples on either side


def taut_moments(motion: Motion, inner: slice) -> BoolArray:
    """Samples into whose low-pass window no slack moment falls."""
    if motion.finger is None:
        return np.ones(len(narrow(motion.time[inner])), dtype=bool)
    pull = (motion.torque - (motion.motor.inertia or 0.0) * motion.acceleration) / motion.radius
    pull -= INERTIA_SPREADS * motion.inertia_spread * np.abs(motion.acceleration) / motion.radius
    smooth = np.convolve(pull, np.ones(9) / 9, mode="same")  # 36 ms: the tension's own noise is then small
    loose = (smooth < SLACK_TENSION_N)[inner]
    # A slack cable hangs through by millimetres, the taut one is known to micrometres: no window that
    # holds a slack moment anywhere but at its very ends may pass for taut.
    reach = np.ones(2 * (NARROW_HALF - NARROW_HALF // 8) + 1)
    near = np.convolve(loose.astype(float), reach, mode="same") > 0.5
    count = narrow_count(len(loose))
    return np.asarray(~near[NARROW_HALF::NARROW_STEP][:count])


def rest_moments(position: Array) -> BoolArray:
    """Decimated samples around which the motor stands, (n,)."""
    angle = np.pad(narrow(position), REST_REACH, mode="edge")
    windows = sliding_window_view(angle, 2 * REST_REACH + 1)
    return np.asarray(np.ptp(windows, axis=1) < np.radians(AT_REST_DEG))

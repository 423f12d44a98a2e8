"""The load cell's zero where it is seen: in runs in the air, and while a tip that presses has let go.

Whoever records for a day finds another zero in each run: a strain gauge warms up, a cable pulls at the mount.
In the air the cell shows its zero itself. So do moments of a run in contact at which the tip is clear of it,
which the joint angles tell. Of a run in which the finger presses all along it is one of the constants of the
run (``gram.run_constants``); how far the others moved says how far that one may have.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fingerlab.diagnosis.settings import (
    CLEAR_S,
    CLEAR_SAMPLES,
    CLEAR_SLOPE,
    FIRST_LOOK_S,
    FORCE_ZERO_RUNS,
    LEAST_FORCE_ZERO,
    LIFTED_M,
    WIDE_RATE_HZ,
    ZERO_SPREADS,
)
from fingerlab.diagnosis.signals.reading_errors import (
    FORCE,
    NO_ERROR,
    ReadingError,
    ReadingErrors,
    RunZeros,
)
from fingerlab.diagnosis.signals.tip_travel import tip_record
from fingerlab.rig.file import Finger
from fingerlab.sessions.model import Array, Run, Session


class SeenZeros(NamedTuple):
    """How far the zeros that runs in the air show are apart.

    ``contrasts``: independent differences between them. ``square``: the sum of their squares, N^2.
    ``resolved``: one standard deviation of what passes for a zero that stands, N.
    """

    contrasts: int
    square: float
    resolved: float

    def log_density(self, spread: float) -> float:
        """Of the differences with zeros that scatter by ``spread`` (N), against zeros that stand."""
        if self.contrasts == 0:
            return 0.0
        known, whole = self.resolved**2, self.resolved**2 + spread**2
        explained = self.square * (1.0 / known - 1.0 / whole)
        return float(0.5 * (explained - self.contrasts * np.log(whole / known)))


def zero_in_the_air(runs: Sequence[Run]) -> float | None:
    """What the load cell reads in runs in which nothing touches it, in its unit; None: none of them tells.

    Zero, where that is no more than readings scatter from run to run, or nothing beside those in contact.
    """
    free = _medians([run for run in runs if run.phase == "on_air"])
    if not len(free):
        return None
    zero = float(np.median(free))
    spread = float(np.std(free)) if len(free) > 1 else 0.0
    pressed = _medians([run for run in runs if run.phase == "contact"])
    least = LEAST_FORCE_ZERO * float(np.median(np.abs(pressed - zero))) if len(pressed) else np.inf
    return zero if abs(zero) > max(least, ZERO_SPREADS * spread) else 0.0


def zeros_in_the_air(runs: Sequence[Run]) -> SeenZeros | None:
    """How far the zeros are apart that the load cell shows in the air; None: too few runs tell."""
    free = _medians([run for run in runs if run.phase == "on_air"])
    pressed = _medians([run for run in runs if run.phase == "contact"])
    if len(free) < 2 or not len(pressed):
        return None
    load = float(np.median(np.abs(pressed - np.median(free))))
    if not load > 0.0 or not np.ptp(free) > 0.0:
        return None
    return SeenZeros(len(free) - 1, float(np.sum((free - free.mean()) ** 2)), LEAST_FORCE_ZERO * load)


def _medians(runs: Sequence[Run]) -> Array:
    """Median reading of some of the runs, evenly among them; without those that hold none."""
    read = [run for run in runs if run.has(FORCE)]
    found = []
    for run in read[:: -(-len(read) // FORCE_ZERO_RUNS) or 1]:
        samples = run.load([FORCE], 0, int(FIRST_LOOK_S * run.sample_rate_hz))[FORCE]
        samples = samples[np.isfinite(samples)]
        found += [float(np.median(samples))] if len(samples) else []
    return np.array(found)


def zeros_while_clear(sessions: Sequence[Session], errors: ReadingErrors) -> RunZeros:
    """The zero of the load cell in each run in contact in whose course the tip is clear of it, by run.

    Beside what is taken off all runs already. Only where one run at least shows another zero than that by
    more than a share of its readings: a cell that stands is left as it is.

    Args:
        errors: that the channels of all runs have.
    """
    found: dict[tuple[str, str], ReadingErrors] = {}
    off = False
    for session in sessions:
        finger = session.rig.finger
        for run in session.runs if finger is not None else ():
            seen = zero_while_clear(run, finger) if finger is not None and run.phase == "contact" else None
            if seen is None:
                continue
            zero, load = seen
            known = errors.get(FORCE, NO_ERROR)
            beside = (1.0 + known.gain) * (zero - known.zero)
            found[str(session.path), run.name] = {FORCE: ReadingError(beside)}
            off |= abs(beside) > LEAST_FORCE_ZERO * load
    return found if off else {}


def zero_while_clear(run: Run, finger: Finger) -> tuple[float, float] | None:
    """What a load cell reads while the tip of a pressing finger is clear of it, N, and what it is pressed by.

    None: it never is for long, be it before it is set down or in the course of its motion. The tip is clear
    where it is further back than wherever it presses, and than one that gives would be under such a force,
    and the reading there no longer goes with its place.
    """
    tip = tip_record(run, finger, CLEAR_SAMPLES / WIDE_RATE_HZ)
    if tip is None or not tip.pressing.any():
        return None
    edge = np.quantile(tip.depth[tip.pressing], 0.02)
    clear = np.maximum(tip.depth - edge, tip.beyond_give) < -LIFTED_M
    if np.count_nonzero(clear) < CLEAR_S * WIDE_RATE_HZ / CLEAR_SAMPLES:
        return None
    depth, force, load = tip.depth, tip.force, tip.load
    zero = float(np.median(force[clear]))
    back = depth[clear] - depth[clear].mean()
    followed = float(back @ force[clear]) / max(float(back @ back), 1e-30) * float(np.std(back))
    if abs(followed) > CLEAR_SLOPE * load or float(np.std(force[clear])) > 2.0 * CLEAR_SLOPE * load:
        return None
    return zero, load

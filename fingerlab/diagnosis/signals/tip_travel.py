"""Where the tip of a pressing finger is while it presses: what the joint angles and the load cell tell of it.

A tip that sticks holds any sideways force within its friction, whichever way it came to be, and a share of
the normal force as well as any other. A force that leans is told from that only by a tip that moves along.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from fingerlab.diagnosis.settings import (
    LEAST_TIP_TRAVEL_M,
    LONGEST_STRETCH_S,
    MOST_TIP_FRICTION,
    PRESSING_SHARE,
    SETTLED_TIP_SHARE,
    TIP_AVERAGE_S,
    TIP_STIFFNESS,
)
from fingerlab.diagnosis.signals.filters import knocks_of, landing_samples
from fingerlab.diagnosis.signals.reading_errors import FORCE, MCP, PIP
from fingerlab.rig.file import Finger
from fingerlab.sessions.model import Array, BoolArray, Run, Session


class TipRecord(NamedTuple):
    """What is read of a tip in contact, averaged, (n,) each: force N, depth and reach m.

    ``depth``: below the MCP joint, against the load cell's axis. ``reach``: in front of it, along the face.
    """

    force: Array
    depth: Array
    reach: Array

    @property
    def load(self) -> float:
        """Between which forces it goes, N."""
        least, most = np.quantile(self.force, (0.02, 0.98))
        return float(most - least)

    @property
    def pressing(self) -> BoolArray:
        """Where it is certain to press, (n,) bool."""
        return np.asarray(self.force > np.quantile(self.force, 0.02) + PRESSING_SHARE * self.load)

    @property
    def beyond_give(self) -> Array:
        """How much deeper it is than its force puts it while it presses, (n,) m: what gives goes back too.

        Depth over force, in a straight line: noise of the angles makes that no steeper.
        """
        force, depth = self.force[self.pressing], self.depth[self.pressing]
        back = force - force.mean()
        give = max(float(back @ depth) / max(float(back @ back), 1e-30), 0.0)
        return np.asarray(self.depth - depth.mean() - give * (self.force - force.mean()))


def tip_record(run: Run, finger: Finger, average_s: float) -> TipRecord | None:
    """The tip of a run, averaged over so long; None: a channel is missing, or nothing is left of it."""
    if not all(run.has(name) for name in (FORCE, MCP, PIP)):
        return None
    read = run.load([FORCE, MCP, PIP], 0, int(LONGEST_STRETCH_S * run.sample_rate_hz))
    step = max(round(average_s * run.sample_rate_hz), 1)
    force, mcp, pip = (_averaged(read[name], step) for name in (FORCE, MCP, PIP))
    known = np.isfinite(force) & np.isfinite(mcp) & np.isfinite(pip)
    if not known.any():
        return None
    proximal, distal = mcp[known] - finger.wrist_angle, (mcp + pip)[known] - finger.wrist_angle
    lengths = 2.0 * finger.proximal_half_length, 2.0 * finger.distal_half_length
    depth = lengths[0] * np.sin(proximal) + lengths[1] * np.sin(distal)
    reach = lengths[0] * np.cos(proximal) + lengths[1] * np.cos(distal)
    return TipRecord(force[known], depth, reach)


def _averaged(values: Array, step: int) -> Array:
    """Means of so many samples each, as far as they go."""
    whole = len(values) // step * step
    return np.asarray(values[:whole].reshape(-1, step).mean(axis=1))


def tips_stick(pairs: Iterable[tuple[Session, Run]]) -> bool:
    """Whether the tip moves along the load cell's face in none of the runs in contact, by more than it gives.

    What sticks takes on its sideways force over a little travel (``TIP_STIFFNESS``); where it has gone no
    further while the normal force came and went, nothing shows that it has slid. Before, it was set down.
    """
    found = []
    for session, run in pairs:
        if run.phase != "contact" or session.rig.finger is None:
            continue
        tip = tip_record(run, session.rig.finger, TIP_AVERAGE_S)
        if tip is None:
            return False
        settled = tip.pressing & (np.arange(len(tip.force)) >= SETTLED_TIP_SHARE * len(tip.force))
        if not settled.any():
            return False
        low, high = np.quantile(tip.reach[settled], (0.02, 0.98))
        most = MOST_TIP_FRICTION * tip.load / TIP_STIFFNESS
        found.append(float(high - low) < most + LEAST_TIP_TRAVEL_M)
    return bool(found) and all(found)


def knocks_at_landing(run: Run) -> bool:
    """Whether a tip knocks on the load cell where it lands, in the first minute of a run."""
    if run.phase != "contact" or not run.has(FORCE):
        return False
    force = run.load([FORCE], 0, int(LONGEST_STRETCH_S * run.sample_rate_hz))[FORCE]
    return bool(knocks_of(force, landing_samples(run.sample_rate_hz)).any())

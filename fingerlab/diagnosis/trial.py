"""A model with its fit and its scores, and what a misfit of many conditions counts.

The misfit of a model is counted in units of the repeatability floor: chi-square per independent value, after
what noise alone would give has been taken away. It is reproducible by construction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fingerlab.diagnosis.fitting import Fit
from fingerlab.diagnosis.groups import GroupKey
from fingerlab.diagnosis.model import Model
from fingerlab.diagnosis.sums import BoolArray
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Reach:
    """What the last effect of a trial would do at its typical strength.

    Attributes:
        falls: by how much the misfit would fall with the effect, (conditions,); chi-square.
        strengths: the typical strength by key of the unknown, SI.
    """

    falls: Array
    strengths: Mapping[str, float]


NO_REACH = Reach(np.zeros(0), {})


@dataclass(frozen=True)
class Trial:
    """A model with its fit and the misfit left on each run.

    ``misfits`` holds one entry a condition of each group: (chi-square without noise, independent values);
    from held-out runs where ``held_out`` is set.
    """

    model: Model
    fit: Fit
    misfits: Array = field(default_factory=lambda: np.zeros((0, 2)))  # (conditions, 2); empty: not counted
    touching: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))  # (conditions,): in contact
    held_out: bool = False
    in_sample: Array = field(default_factory=lambda: np.zeros((0, 2)))
    """As ``misfits``, always of the fit to all runs: where trials are compared that are not all held out.

    Empty where it was not asked for (see ``Study.told``)."""
    residuals: Mapping[GroupKey, Array] = field(default_factory=dict)
    """Mean products of the equations' residuals for each group, (5, 5) over ``Row``, noise included."""
    widening: float = 0.0
    """What it costs in twice the log density that sticking friction may hold any value at rest."""
    surprise: float = 0.0
    """What the constants of the joints' equations cost in twice the log density (see ``losses``)."""
    reach: Reach = NO_REACH
    """What the last effect would do at its typical strength (see ``Study.told``)."""

    @property
    def misfit(self) -> float:
        """Chi-square without noise, every condition counting with the root of its length."""
        return float(self.misfits[:, 0] @ condition_weights(self.misfits[:, 1]))

    @property
    def misfit_in_contact(self) -> float:
        """The part of it that lies in contact."""
        weighted = self.misfits[:, 0] * condition_weights(self.misfits[:, 1])
        return float(weighted[self.touching].sum())

    @property
    def misfit_in_sample(self) -> float:
        """As ``misfit``, of the fit to all runs."""
        return float(self.in_sample[:, 0] @ condition_weights(self.in_sample[:, 1]))

    @property
    def fall_in_reach(self) -> float:
        """By how much the misfit would fall with the last effect if it had its typical strength."""
        if not len(self.reach.falls):
            return 0.0
        return float(self.reach.falls @ condition_weights(self.misfits[:, 1]))

    @property
    def count(self) -> float:
        """Independent values behind ``misfit``."""
        return float(self.misfits[:, 1].sum())

    @property
    def score(self) -> float:
        """Error over all equations and samples in units of the repeatability floor; 1.0 is the floor."""
        return float(np.sqrt(1.0 + max(float(self.misfits[:, 0].sum()), 0.0) / max(self.count, 1.0)))


def condition_weights(counts: Array) -> Array:
    """What each value of a condition counts, (conditions,); 1 on average.

    What no model explains is partly the same in every run of a condition, and partly another in each: a
    condition counts with the root of its length.

    Args:
        counts: independent values of each condition, (conditions,).
    """
    if not len(counts) or counts.sum() <= 0:
        return np.ones(len(counts))
    weights = 1.0 / np.sqrt(np.maximum(counts, 1.0))
    return np.asarray(weights * counts.sum() / float(weights @ counts))

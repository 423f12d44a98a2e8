"""Fitted models that leave what a test wants them to, without any recording behind them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.solver import Fit
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.effects import CATALOGUE

COUNT = 3000.0


def leaving(left: float, *effects: str) -> FittedModel:
    """A model with these effects whose squared score is ``left`` above one on each of ten held-out runs."""
    misfit = left * COUNT
    choices = tuple(Choice(CATALOGUE[e]) for e in effects)
    misfits = np.tile((misfit / 10, COUNT / 10), (10, 1))
    keys = [f"{c.effect.id}.{gain}" for c in choices for gain in c.effect.gains]
    fit = Fit(np.ones(len(keys)), np.eye(len(keys)), misfit)
    last_gains = list(choices[-1].effect.gains) if choices else []
    index = {key: i for i, key in enumerate(keys)}
    gains = [(c.effect.id, name, gain) for c in choices for name, gain in c.effect.gains.items()]
    features = [SimpleNamespace(parameter=name) for _, name, _ in gains]
    unknowns = [SimpleNamespace(effect=owner, parameter=gain) for owner, _, gain in gains]

    def indices(owner: str, shape: int) -> list[int]:
        return [i for i, (mine, _, _) in enumerate(gains) if mine == owner]

    layout = SimpleNamespace(features=features, indices=indices)
    model = SimpleNamespace(
        choices=choices, index=index, last_gains=last_gains, layout=layout, unknowns=unknowns
    )
    return FittedModel(cast(Any, model), fit, {}, misfits, held_out=True)


def at_score(score: float, *effects: str) -> FittedModel:
    """A model with these effects that is at ``score`` floors on each of ten held-out runs."""
    return leaving(score**2 - 1.0, *effects)

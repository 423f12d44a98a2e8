"""Effects that are alike on their grids: each is looked at again, and what then leaves less is named."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fingerlab.core.progress import SILENT
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.selection import USUAL_LEFT, by_what_is_left
from fingerlab.diagnosis.search import grid_refinement as rivals
from fingerlab.diagnosis.search import path
from fingerlab.effects import CATALOGUE

COUNT = 1000.0


def trial(name: str, left: float) -> Any:
    model = SimpleNamespace(choices=(Choice(CATALOGUE[name]),))
    return SimpleNamespace(model=model, misfit=left * COUNT, count=COUNT)


class Bench:
    """A study in which every effect leaves of each value what ``closely`` says."""

    def __init__(self, closely: dict[str, float]) -> None:
        self.closely = closely
        self.weights: Any = "first"
        self.asked: list[str] = []

    def fit(self, choices: tuple[Choice, ...], *_: Any) -> Any:
        return trial(choices[0].effect.id, self.closely[choices[0].effect.id])

    def hold_out(self, one: Any) -> Any:
        return one

    def look(self, _: Any, choices: tuple[Choice, ...], *rest: Any) -> Any:
        self.asked.append(choices[0].effect.id)
        return self, self.fit(choices)


def by_misfit(_: Any, trials: list[Any]) -> Any:
    """Odds without what the unknowns cost."""
    log = by_what_is_left(np.array([t.misfit / t.count for t in trials]))
    return log - log.max()


def told(bench: Bench, left: float, monkeypatch: pytest.MonkeyPatch) -> Evidence:
    """The evidence after a look at capstan and load-dependent friction, alike on their grids."""
    trials = [trial("load_dependent_friction", left), trial("capstan_friction", 1.001 * left)]
    odds = np.array([0.0, -0.01])
    shares = np.exp(odds) / np.exp(odds).sum()
    base = SimpleNamespace(model=SimpleNamespace(choices=()))
    before: Any = Evidence(base, tuple(trials), shares, odds, 0.0, 0.0, 1.0, np.zeros(3), least_left=left)  # type: ignore[arg-type]
    monkeypatch.setattr(rivals, "look_again", bench.look)
    monkeypatch.setattr(rivals, "among", by_misfit)
    monkeypatch.setattr(rivals, "density", lambda study, one: one.misfit)
    study: Any = bench
    return rivals.looked_at_closely([], study, before, SILENT)


def test_the_one_that_leaves_less_between_its_points_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench({"load_dependent_friction": 16.0, "capstan_friction": 3.0})
    after = told(bench, 17.0, monkeypatch)
    assert sorted(bench.asked) == ["capstan_friction", "load_dependent_friction"]
    # (16 + 0.02 - 0.14) / (3 + 0.02 - 0.14) to the power of half of sixteen values
    odds = ((16.0 + 0.02 - USUAL_LEFT) / (3.0 + 0.02 - USUAL_LEFT)) ** 8
    assert after.probabilities[1] / after.probabilities[0] == pytest.approx(odds, rel=0.02)
    assert after.probabilities.sum() == pytest.approx(1.0)
    assert bench.weights == "first"  # as they were


def test_alike_they_stay_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    after = told(Bench({"load_dependent_friction": 5.0, "capstan_friction": 5.0}), 6.0, monkeypatch)
    assert after.probabilities == pytest.approx([0.5, 0.5], abs=0.01)


def test_what_every_bench_leaves_is_not_looked_into(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench({"load_dependent_friction": 0.1, "capstan_friction": 0.0})
    after = told(bench, 0.9 * USUAL_LEFT, monkeypatch)
    assert not bench.asked
    assert after.probabilities == pytest.approx([0.5, 0.5], abs=0.01)


def test_a_way_adds_one_effect_at_each_step() -> None:
    """Begun with hardening, then harmonic error, hardening made needless by stiffness: two steps are left."""
    names = {"h": "spring_hardening", "a": "angle_sensor_nonlinearity", "s": "stiffness_error"}

    def step(letters: str) -> Any:
        choices = tuple(Choice(CATALOGUE[names[x]]) for x in letters)
        return SimpleNamespace(model=SimpleNamespace(choices=choices))

    def ids(one: Any) -> list[str]:
        return [c.effect.id for c in one.model.choices]

    study: Any = SimpleNamespace(
        weights=0,
        hold_out=lambda one: one,
        fit=lambda choices, *_: SimpleNamespace(model=SimpleNamespace(choices=choices)),
    )
    weights: Any = [1, 2, 3, 4]
    steps, kept = path._straight(study, [step(""), step("h"), step("ha"), step("as")], weights, 0)
    assert [ids(one) for one in steps] == [[], [names["a"]], [names["a"], names["s"]]]
    assert kept == [4, 4, 4]
    straight, kept = path._straight(study, [step(""), step("a"), step("as")], weights[:3], 0)
    assert [len(ids(one)) for one in straight] == [0, 1, 2]
    assert kept == [1, 2, 3]

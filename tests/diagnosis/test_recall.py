"""A second reading of the same runs, with what the first left: the sums of a reading from the file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.gram import runs as recalling
from fingerlab.diagnosis.gram.reduction import reduce_sessions
from fingerlab.diagnosis.gram.runs import Recall
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect
from fingerlab.sessions import Session

from . import closed_form as made

FIRST = ("coulomb_friction", "motor_spring", "contact_compliance")
SEARCHED = [CATALOGUE[name] for name in FIRST]


def closer(name: str) -> Effect:
    """The effect with the shapes of a second look around the first of its grid."""
    effect = CATALOGUE[name]
    return replace(effect, shapes=tuple(effect.closer(effect.shapes[0])))


LOOKED_AT = [closer("coulomb_friction"), CATALOGUE["motor_viscous_friction"], closer("capstan_friction")]


@pytest.fixture(scope="module")
def session() -> Session:
    return made.session(made.Bench(), 3, contact=2)


def assert_same_sums(one: Reduced, other: Reduced) -> None:
    assert one.layout.features == other.layout.features
    assert np.array_equal(one.layout.signals, other.layout.signals)
    for mine, theirs in zip(one.groups, other.groups, strict=True):
        assert mine.key == theirs.key
        assert mine.encoder_variance == theirs.encoder_variance
        assert np.array_equal(mine.noise, theirs.noise)
        for a, b in zip(mine.folds, theirs.folds, strict=True):
            assert (a.taut_samples, a.slack_samples, a.rest_samples) == (
                b.taut_samples, b.slack_samples, b.rest_samples
            )  # fmt: skip
            assert np.array_equal(a.products, b.products)


def test_what_is_recalled_gives_the_sums_of_a_fresh_reading(session: Session) -> None:
    recall = Recall()
    reduce_sessions([session], SEARCHED, recall=recall)
    assert all(number in recall for number in range(len(session.runs)))
    again = reduce_sessions([session], LOOKED_AT, recall=recall)
    assert_same_sums(again, reduce_sessions([session], LOOKED_AT))


def test_what_has_no_room_is_read_again(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = Recall()
    reduce_sessions([session], SEARCHED, recall=whole)
    one_run = sum(seen.size for seen in whole.stretches(0))
    monkeypatch.setattr(recalling, "MOST_BYTES", 2 * one_run + one_run // 2)
    recall = Recall()
    reduce_sessions([session], SEARCHED, recall=recall)
    kept = [number for number in range(len(session.runs)) if number in recall]
    assert kept == [0, 1]
    again = reduce_sessions([session], LOOKED_AT, recall=recall)
    assert_same_sums(again, reduce_sessions([session], LOOKED_AT))


def test_states_with_memory_are_not_kept(session: Session) -> None:
    """They are many times what they were made from, and another shape's are others."""
    recall = Recall()
    reduce_sessions([session], SEARCHED, recall=recall)
    first, second = (next(recall.stretches(0)).motion for _ in range(2))
    first.remember("anything", lambda: np.ones(3))
    assert not second._memory

"""A reduction that is kept: every answer is that of a fresh reading, and few columns are formed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import Cancelled
from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect
from fingerlab.physics.motion import Motion
from fingerlab.sessions import Session, open_session

from . import closed_form as made

GIVEN = ("coulomb_friction", "cable_stretch")


def told(found: Diagnosis) -> str:
    """All that a diagnosis says, but the seconds."""
    return json.dumps({key: value for key, value in found.to_json().items() if key != "seconds"})


@pytest.fixture(scope="module")
def session() -> Session:
    return made.session(made.Bench(), 3, contact=2)


@pytest.fixture(scope="module")
def kept(session: Session) -> Reduction:
    """What is left of a diagnosis of the nominal model, and of other effects that were added and undone."""
    kept = Reduction([session])
    for added in ((), ("joint_stop",), GIVEN):
        diagnose([session], added, kept=kept)
    return kept


@pytest.mark.parametrize("added", [(), GIVEN[:1], GIVEN])
def test_an_added_effect_is_judged_as_by_a_fresh_diagnosis(
    session: Session, kept: Reduction, added: Sequence[str]
) -> None:
    assert told(diagnose([session], added, kept=kept)) == told(diagnose([session], added))


def counted_columns(name: str, counts: list[str]) -> Effect:
    """The built-in effect, which notes when its columns are formed."""
    effect = CATALOGUE[name]

    def columns(motion: Motion, shape: object) -> object:
        counts.append(name)
        return effect.columns(motion, shape)  # type: ignore[arg-type]

    return replace(effect, columns=columns)  # type: ignore[arg-type]


def test_columns_are_formed_once_for_each_segment(session: Session) -> None:
    formed: list[str] = []
    effect, other = counted_columns("motor_viscous_friction", formed), CATALOGUE["viscous_friction"]
    kept = Reduction([session])
    first = kept.of([effect, other])
    assert len(formed) == len(session.runs) + 1  # once more for the layout
    formed.clear()
    again = kept.of([effect, other])
    assert len(formed) == 1
    for one, two in zip(first.groups, again.groups, strict=True):
        assert np.array_equal(one.whole.products, two.whole.products)
        assert np.array_equal(one.noise, two.noise)


def test_files_are_read_once(shared_data: Path) -> None:
    session = open_session(shared_data / "bench-small.h5")
    kept = Reduction([session])
    diagnose([session], kept=kept)
    read = []
    for run in session.runs:
        load = run.load
        object.__setattr__(run, "load", lambda *a, load=load: read.append(a) or load(*a))
    diagnose([session], ("coulomb_friction",), kept=kept, with_curves=False)
    assert not read


def test_a_pass_that_was_stopped_leaves_nothing(session: Session) -> None:
    kept, asked = Reduction([session]), []

    def stop() -> bool:
        asked.append(None)
        return len(asked) > 3

    with pytest.raises(Cancelled):
        diagnose([session], cancelled=stop, kept=kept)
    assert told(diagnose([session], GIVEN[:1], kept=kept)) == told(diagnose([session], GIVEN[:1]))


def test_another_catalogue_begins_anew(session: Session, kept: Reduction) -> None:
    without = {"left_out": ["coulomb_friction"]}
    assert told(diagnose([session], kept=kept, **without)) == told(diagnose([session], **without))


def test_what_has_no_room_is_read_again(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fingerlab.diagnosis.gram.runs.MOST_BYTES", 0)
    kept = Reduction([session])
    diagnose([session], kept=kept)
    found = diagnose([session], GIVEN[:1], kept=kept)
    assert told(found) == told(diagnose([session], GIVEN[:1]))

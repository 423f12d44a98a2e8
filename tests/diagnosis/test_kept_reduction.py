"""A reduction that is kept: every answer is that of a fresh reading, and few columns are formed."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import Cancelled
from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.results import Diagnosis, FirstLook
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect
from fingerlab.physics.motion import Motion
from fingerlab.sessions import Session, open_session
from fingerlab.sessions.model import Run

from . import closed_form as made

GIVEN = ("coulomb_friction", "cable_stretch")


def told(found: Diagnosis) -> str:
    """All that a diagnosis says, but the seconds."""
    return json.dumps({key: value for key, value in found.to_json().items() if key != "seconds"})


@pytest.fixture(scope="module")
def session() -> Session:
    return made.session(made.Bench(), 3, contact=2)


@pytest.fixture(scope="module")
def left(session: Session) -> tuple[Reduction, Diagnosis]:
    """What is left of a diagnosis of the nominal model, and of other effects that were added and undone."""
    kept = Reduction([session])
    options = DiagnosisOptions(kept=kept)
    *_, last = [diagnose([session], added, options=options) for added in ((), ("joint_stop",), GIVEN)]
    return kept, last


@pytest.fixture(scope="module")
def fresh(session: Session) -> Callable[[Sequence[str]], str]:
    """What a diagnosis that keeps nothing says, with these effects added; worked out once."""
    return cache(lambda added: told(diagnose([session], added)))


@pytest.mark.parametrize("added", [GIVEN])
def test_an_added_effect_is_judged_as_by_a_fresh_diagnosis(
    session: Session,
    left: tuple[Reduction, Diagnosis],
    fresh: Callable[[Sequence[str]], str],
    added: Sequence[str],
) -> None:
    looks: list[FirstLook] = []
    kept, before = left
    options = DiagnosisOptions(kept=kept, first=looks.append, before=before)
    found = diagnose([session], added, options=options)
    assert told(found) == fresh(added)
    assert {look.model for look in looks} == ({tuple(added)} if added else set())
    for look in looks[-1:]:
        assert look.score == pytest.approx(found.score, rel=0.1)
        for family, error in found.errors.items():
            assert look.errors[family].rmse == pytest.approx(error.rmse, rel=0.1)


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
    diagnose([session], options=DiagnosisOptions(kept=kept))
    read = []
    for run in session.runs:
        load = run.load
        object.__setattr__(run, "load", lambda *a, load=load: read.append(a) or load(*a))
    added = ("motor_coulomb_friction",)  # the one that it lacks: nothing is to be looked for beside it
    diagnose([session], added, with_curves=False, options=DiagnosisOptions(kept=kept))
    assert not read


def test_a_pass_that_was_stopped_leaves_nothing(
    session: Session, fresh: Callable[[Sequence[str]], str]
) -> None:
    kept, asked = Reduction([session]), []

    def stop() -> bool:
        asked.append(None)
        return len(asked) > 3

    with pytest.raises(Cancelled):
        diagnose([session], cancelled=stop, options=DiagnosisOptions(kept=kept))
    assert told(diagnose([session], GIVEN[:1], options=DiagnosisOptions(kept=kept))) == fresh(GIVEN[:1])


def test_another_catalogue_begins_anew(session: Session, left: tuple[Reduction, Diagnosis]) -> None:
    without = DiagnosisOptions(left_out=["coulomb_friction"])
    again = diagnose([session], options=replace(without, kept=left[0]))
    assert told(again) == told(diagnose([session], options=without))


def test_what_has_no_room_is_read_again(
    session: Session, fresh: Callable[[Sequence[str]], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fingerlab.diagnosis.gram.decimation.MOST_BYTES", 0)
    kept = Reduction([session])
    diagnose([session], options=DiagnosisOptions(kept=kept))
    found = diagnose([session], GIVEN[:1], options=DiagnosisOptions(kept=kept))
    assert told(found) == fresh(GIVEN[:1])


def test_of_a_long_run_little_is_kept(session: Session) -> None:
    """What is formed of each minute, some 16 MB for so few effects, is not held until the run has passed."""

    def most(minutes: int) -> float:
        """MB at once."""
        run = session.runs[0]
        times = np.arange(minutes * 60 * round(run.sample_rate_hz)) / run.sample_rate_hz
        channels = {name: np.resize(run.channel(name), len(times)) for name in run.units}
        long = Run.from_arrays(
            {**channels, "time": times}, name="001", phase=run.phase, cable=run.cable,
            sample_rate_hz=run.sample_rate_hz, trajectory=run.trajectory,
        )  # fmt: skip
        tracemalloc.start()
        Reduction([replace(session, runs=(long,))]).of(list(CATALOGUE.values())[::4])
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak / 1e6

    per_minute = (most(3) - most(1)) / 2
    assert per_minute < 12.0

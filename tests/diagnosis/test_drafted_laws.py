"""A law that no effect of the catalogue is, planted in recordings of closed form, is drafted from them."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.text import ParameterEstimate
from fingerlab.diagnosis.draft.laws import DraftLaw, LawTerm, cause, draft_laws
from fingerlab.diagnosis.draft.library import library
from fingerlab.diagnosis.draft.own_file import own_effect_text
from fingerlab.diagnosis.draft.terms import PLACES, VARIABLES, DraftTerm, TermColumns
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.bench_constants import settle_constants
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.effects import CATALOGUE, Effect, own
from fingerlab.effects.own_checks import _probes
from fingerlab.sessions import SessionWriter
from fingerlab.sessions.model import Array, Session
from tests.cli.calling import run_command

from . import closed_form as made

TORQUE_PER_AMPERE = made.RIG.motor.torque_constant * made.RIG.motor.gear_ratio
TRAVEL = {"mcp": (-0.2, 0.9), "pip": (-0.3, 1.1)}  # rad
DRAG = 2.0e-3  # N m (s/rad)^2, of the motor


def drag(speed: Array) -> Array:
    """A motor torque, N m, by the square of its speed, rad/s."""
    return DRAG * speed * np.abs(speed)


@pytest.fixture(scope="module")
def planted() -> Session:
    plain = made.session(made.Bench(), 1, contact=0)
    return replace(plain, runs=tuple(made.with_motor_torque(run, drag) for run in plain.runs[:5]))


def drafted(session: Session) -> tuple[DraftLaw, ...]:
    """Laws beside the nominal model, without a diagnosis before."""
    kept = Reduction([session])
    kept.begin([], read=True)
    scorer = settle_constants(kept, Scorer(kept.of([])))
    bare = scorer.score_held_out(scorer.bare)
    return draft_laws(kept, bare, bare, with_curves=True)


@pytest.fixture(scope="module")
def laws(planted: Session) -> tuple[DraftLaw, ...]:
    return drafted(planted)


def test_the_planted_law_is_first_with_its_coefficient(laws: tuple[DraftLaw, ...]) -> None:
    assert 1 <= len(laws) <= 3
    best = laws[0]
    assert [(t.place, t.variables) for t in best.terms] == [("motor", ("motor speed",))]
    found = best.terms[0].coefficients["c"]
    assert best.terms[0].words == "square of motor speed, against it"
    assert found.unit == "N m s^2/rad^2"
    assert found.value == pytest.approx(DRAG, rel=0.05)
    assert found.low < DRAG < found.high
    assert best.score < 1.15 < 2.0 < best.score_before
    assert best.simpler == (best.score,)
    assert "grows with speed" in best.cause
    seen = best.fingerprint
    assert seen is not None
    assert (seen.coordinate, seen.equation) == ("motor speed", "pip_torque")
    arm = made.Bench().arms[-1][1]  # tension over the pulley's radius, as a torque of the joint
    law = -arm * DRAG / made.RADIUS * seen.centre * np.abs(seen.centre)
    for curve in (seen.mean, seen.curve):
        assert np.corrcoef(law, curve)[0, 1] > 0.97
    assert best.equation == r"\tau_m = C_{1}\,\dot\theta_m|\dot\theta_m|"


def test_a_plain_bench_drafts_nothing() -> None:
    plain = made.session(made.Bench(), 2, contact=0)
    assert drafted(replace(plain, runs=plain.runs[:5])) == ()


def one_term(term: DraftTerm) -> DraftLaw:
    """A law of one term, as if it had been found."""
    each = zip(term.gains, term.units, strict=True)
    found = {gain: ParameterEstimate(-0.5, unit, -0.6, -0.4) for gain, unit in each}
    told = LawTerm(
        term.place, PLACES[term.place].title, term.words, term.parts[0].latex, term.variables, found,
        dict.fromkeys(found, -0.5), term,
    )  # fmt: skip
    return DraftLaw((told,), (), 5.0, 1.1, (1.1,), None, 5.0, cause([told]), None)  # type: ignore[arg-type]


def test_the_file_of_every_term_computes_what_was_fitted() -> None:
    terms = list(library(TRAVEL, True, True, (4.0,), 1.0, 1.0))
    assert len({term.id for term in terms}) == len(terms) > 150
    probes = {on_bench: _probes(on_bench)[-2:] for on_bench in (False, True)}
    places = set[str]()
    for term in terms:
        assert set(term.variables) <= set(VARIABLES)
        names: dict[str, Effect] = {}
        exec(own_effect_text(Path("my_law.py"), one_term(term)), names)
        effect = names["EFFECT"]
        if term.place not in places:  # as it is looked at before it is let in
            effect = own.checked(effect, "my_law.py")
            places.add(term.place)
        assert [gain.low for gain in effect.gains.values()] == [-2.0] * len(term.parts)
        for motion in probes[term.place == "bench"]:
            ours, theirs = TermColumns(term)(motion, {}), effect.columns(motion, {})
            assert [(t.row, t.scale) for t in ours] == [(t.row, t.scale) for t in theirs]
            for one, other in zip(ours, theirs, strict=True):
                assert np.array_equal(one.values, other.values)
    assert places == set(PLACES)


def test_the_command_drafts_writes_and_the_effect_is_ranked(
    planted: Session,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    few = {name: CATALOGUE[name] for name in ("viscous_friction", "motor_coulomb_friction", "motor_inertia")}
    module = sys.modules["fingerlab.diagnosis.diagnose"]
    monkeypatch.setattr(module, "whole_catalogue", lambda: few | own_ones())
    with SessionWriter(Path("s.h5"), planted.rig, "planted") as writer:
        for run in planted.runs[:3]:
            channels = {**run.load(), "motor_current": run.channel("motor_torque") / TORQUE_PER_AMPERE}
            writer.add_run(run.phase, run.cable, run.sample_rate_hz, run.trajectory, channels)
    asked = ("diagnose", "s.h5", "--draft", "--draft-effect", "air_drag.py", "--json", "d.json")
    assert run_command(*asked) == 0
    said = capsys.readouterr().out
    assert "1. torque of motor and cable by square of motor speed" in said
    law = json.loads(Path("d.json").read_text(encoding="utf-8"))["draft"][0]
    assert law["terms"][0]["variables"] == ["motor speed"]
    assert law["score"] < law["catalogue"]["score"]
    assert run_command("effects", "--folder", tmp_path, "--trust", "air_drag.py") == 0
    assert run_command("diagnose", "s.h5", "--json", "again.json") == 0
    again = json.loads(Path("again.json").read_text(encoding="utf-8"))
    assert again["candidates"][0]["effect"] == "air_drag"
    assert again["candidates"][0]["parameters"]["c1"]["value"] == pytest.approx(DRAG, rel=0.05)
    assert run_command("diagnose", "s.h5", "--draft-effect", "air_drag.py") == 2
    assert run_command("diagnose", "s.h5", "--draft-effect", "7.txt") == 2


def own_ones() -> dict[str, Effect]:
    return {e.id: e for file in own.own_files(CATALOGUE) for e in file.effects}

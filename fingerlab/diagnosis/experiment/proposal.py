"""The run, of those that the rig can do, after which the true effect most probably stays alone in the set."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fingerlab.diagnosis.experiment.predicted_runs import Proposal, menu
from fingerlab.diagnosis.experiment.separation import (
    PredictedRun,
    RunKind,
    SessionFeatures,
    columns_of_run,
    effects_in,
    gain_calibration,
    outlook,
    predict_run,
    run_kind,
)
from fingerlab.diagnosis.experiment.worth import Among, Hidden, Judged
from fingerlab.diagnosis.gram.decimation import Decimated
from fingerlab.diagnosis.score.calibration import Predicted
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import (
    DECISIVE,
    DURATION_S,
    LEAST_MORE,
    LEAST_SEPARATION,
    LENGTHS_S,
    LOOKED_AT,
    PROPOSAL_CANDIDATES,
    SETTLING_S,
)
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Session


@dataclass(frozen=True)
class NextRun:
    """The proposed run as in ``diagnose --json``, and what was predicted of it before any correction."""

    proposal: dict[str, Any]
    predicted: Predicted


def propose(
    sessions: Sequence[Session],
    scorer: Scorer,
    evidence: Evidence,
    chosen: Sequence[int],
    usual: SessionFeatures,
) -> NextRun | None:
    """The run after which one effect most probably stays alone in the set; None where none is worth it.

    What it separates is said for the first effect and that of its rivals in the set that comes off worst.

    Args:
        chosen: effects that are left open, likeliest first. usual: what ``session_features`` says.
    """
    if len(chosen) < 2:
        return None
    view = Among(scorer, evidence, list(chosen[: 1 + PROPOSAL_CANDIDATES]), outlook(evidence, usual))
    first = evidence.candidates[chosen[0]]
    rivals = [evidence.candidates[i] for i in chosen[: 1 + PROPOSAL_CANDIDATES]]
    runs = list(_runs(sessions, scorer, first, rivals))
    best = best_run(runs, view.judged, view.glanced)
    if best is None or best[1].expected < LEAST_SEPARATION:
        return None
    if view.alone_now and best[1].alone < view.alone_now + LEAST_MORE:
        return None
    return _next(scorer, view, *best)


def reveal(
    sessions: Sequence[Session],
    scorer: Scorer,
    evidence: Evidence,
    hidden: Sequence[int],
    usual: SessionFeatures,
) -> NextRun | None:
    """The run that would show the effects that these data could not, and which; None where none would.

    What is expected is said for the likeliest effect that the run would show at its typical strength.
    """
    able = [i for i in hidden if evidence.candidates[i].sensitivity.strengths][:PROPOSAL_CANDIDATES]
    if not able:
        return None
    view = Hidden(scorer, evidence, able, list(hidden), outlook(evidence, usual))
    runs = list(_runs(sessions, scorer, evidence.base, [there for there, _ in view.pairs]))
    best = best_run(runs, view.judged, view.glanced)
    if best is None or not best[1].separates:
        return None
    return _next(scorer, view, *best)


def _next(scorer: Scorer, view: Among | Hidden, proposal: Proposal, found: Judged) -> NextRun:
    as_json = proposal.to_json(list(found.separates), found.expected, scorer.reduced.layout.scales)
    as_json |= {
        "expected_if": dict(found.each),
        "chance_alone": min(found.alone, 1.0),
        "foretelling": gain_calibration().version,
    }
    return NextRun(as_json, Predicted(view.verdict, found.gains, proposal.phase == "motor_bench"))


def best_run(
    runs: Sequence[tuple[Proposal, PredictedRun]],
    judge: Callable[[PredictedRun], Judged],
    glance: Callable[[PredictedRun], tuple[float, ...]] | None = None,
) -> tuple[Proposal, Judged] | None:
    """The run of the most worth; a longer one only where no shorter one decides everything.

    ``glance`` says cheaply which runs are worth to be judged.
    """
    best: tuple[Proposal, Judged] | None = None
    if glance is not None and len(runs) > LOOKED_AT:
        runs = sorted(runs, key=lambda one: glance(one[1]), reverse=True)[:LOOKED_AT]
    for seconds in LENGTHS_S:
        for proposal, run in _lasting(runs, seconds):
            found = judge(run)
            if best is None or found.worth > best[1].worth:
                best = proposal, found
        if best is not None and best[1].least >= DECISIVE:
            break
    return best


def _runs(
    sessions: Sequence[Session], scorer: Scorer, like: FittedModel, candidates: Sequence[FittedModel]
) -> Iterator[tuple[Proposal, PredictedRun]]:
    """Every run of the menu, as the model ``like`` would move, with the columns of all ``candidates``."""
    beside, kinds = not scorer.reduced.on_bench, dict[tuple[str, int, bool], RunKind]()
    nuisances = scorer.reduced.layout.nuisances
    before: tuple[Motion, Decimated] | None = None  # several changes are tried on one motion
    for proposal in menu(sessions, scorer.reduced, like.values):
        motion = proposal.motion
        name = motion.phase, motion.cable_sign, motion.intervention is None
        if name not in kinds:
            acting = effects_in(candidates, motion)
            kinds[name] = run_kind(sessions[0], motion, acting, beside, nuisances)
        if proposal.before is None:
            yield proposal, predict_run(motion, kinds[name])
            continue
        if before is None or before[0] is not proposal.before:
            before = proposal.before, columns_of_run(proposal.before, kinds[name])
        yield proposal, predict_run(motion, kinds[name], before[1])


def _lasting(
    runs: Sequence[tuple[Proposal, PredictedRun]], seconds: float
) -> Iterator[tuple[Proposal, PredictedRun]]:
    times = (seconds - SETTLING_S) / (DURATION_S - SETTLING_S)
    for proposal, run in runs:
        yield replace(proposal, seconds=seconds), run.lasting(times)

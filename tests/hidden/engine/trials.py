"""Blind trials on sessions of this bench: what went in, what the diagnosis says, and whether they agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fingerlab.diagnosis import diagnose
from fingerlab.sessions import open_session

from .session import record


@dataclass(frozen=True)
class Trial:
    """One session and its diagnosis.

    Attributes:
        truth: strength by effect, SI. rank: of the (first) true effect, from 1; 0 without an effect.
        could_show: what the diagnosis says of every true effect: at a plausible strength it would show.
        in_set: all true effects are in the set or in the final model; with none, none is claimed
            (the set then holds what could not show).
        score: of the nominal model. final_score: with the final model, or with the first candidate.
    """

    protocol: str
    seed: int
    truth: Mapping[str, float]
    verdict: str
    rank: int
    could_show: bool
    in_set: bool
    found: tuple[str, ...]
    model: tuple[str, ...]
    score: float
    final_score: float

    @property
    def first(self) -> bool:
        """Whether the true effect leads, or none is claimed where there is none."""
        return self.rank == 1 if self.truth else self.verdict == "nothing_missing"

    def line(self) -> str:
        """The trial in one line of a table."""
        within = "in" if self.in_set else "--" if self.could_show else "weak"
        truth = ", ".join(f"{name} {value:.3g}" for name, value in self.truth.items()) or "nothing"
        return (
            f"{self.protocol:7} {self.seed:3d} {truth:40} {self.verdict:17} {self.rank:3d} "
            f"{within:4} {self.score:7.2f} {self.final_score:6.2f}  "
            f"{'+'.join(self.model)} | {' '.join(self.found)}"
        )


def blind_trial(
    effects: Mapping[str, float | None],
    seed: int,
    protocol: str,
    folder: Path,
    duration_s: float | None = None,
) -> Trial:
    """Record a session with the effects in ``folder``, diagnose the file, and compare."""
    path = folder / f"{protocol}-{'-'.join(effects) or 'plain'}-{seed}.h5"
    truth = record(path, protocol, effects, seed, duration_s)["effects"]
    answer = diagnose([open_session(path)], with_curves=False)
    path.unlink()
    order = [candidate.effect for candidate in answer.candidates]
    ranks = [order.index(name) + 1 for name in truth if name in order]
    shows = {candidate.effect: candidate.detectable for candidate in answer.candidates}
    claimed = set(answer.set) | set(answer.final_model)
    return Trial(
        protocol=protocol,
        seed=seed,
        truth=truth,
        verdict=answer.verdict,
        rank=min(ranks, default=0),
        could_show=all(shows.get(name, True) for name in truth),
        in_set=set(truth) <= claimed if truth else answer.verdict == "nothing_missing",
        found=tuple(answer.set),
        model=tuple(answer.final_model),
        score=answer.score,
        final_score=answer.path[-1].score,
    )

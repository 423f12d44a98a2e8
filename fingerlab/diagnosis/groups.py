"""Which runs are analysed, and which belong together.

Runs of one routing and phase are a group: they share moment arms, losses and noise. A group's runs are dealt
to folds, which are held out of a fit one turn at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.conditions import Fold, deal
from fingerlab.diagnosis.features import Layout
from fingerlab.diagnosis.sums import Sums, total
from fingerlab.sessions.model import Array, Run, Session

FOLDS = 10
"""Runs of a condition are dealt to at most this many folds; ten runs or fewer are held out one by one."""

GroupKey = tuple[str, str]


@dataclass
class Group:
    """Runs of one routing and phase: they share moment arms, losses and noise.

    ``noise`` (signals, signals) holds products of what does not repeat from cycle to cycle. ``dealt`` says of
    every fold which runs it holds; empty: every fold has its turn, all runs are of one condition.
    """

    key: GroupKey
    cable_sign: int
    folds: list[Sums]
    noise: Array
    noise_samples: float = 0.0
    taut_noise: Array | None = None
    """What noise adds to the products at one taut moment, (signals, signals); None: as at any other."""
    encoder_variance: float = 0.0  # m^2 of cable: what a standing encoder's step leaves open
    dealt: list[Fold] = field(default_factory=list)
    trends: dict[tuple[int, int], list[Array]] = field(default_factory=dict)
    """While runs are read: slow trends by condition and stretch, (signals, degrees) for each run."""

    def __post_init__(self) -> None:
        self.dealt = self.dealt or [Fold(0, k) for k in range(len(self.folds))]

    @cached_property
    def whole(self) -> Sums:
        """Sums over all folds; asked for when all runs are in."""
        return total(self.folds)

    @property
    def conditions(self) -> list[int]:
        """The conditions that its runs were recorded under."""
        return sorted({fold.condition for fold in self.dealt})

    def of_turn(self, turn: int) -> list[int]:
        """Indices of the folds that are left out in this turn; none where nothing else would be left."""
        found = [k for k, fold in enumerate(self.dealt) if fold.turn == turn]
        return found if len(found) < len(self.folds) else []

    def without(self, k: int) -> Group:
        """The group less one of its folds."""
        folds, dealt = list(self.folds), list(self.dealt)
        del folds[k], dealt[k]
        return replace(self, folds=folds, dealt=dealt)

    def of_condition(self, condition: int) -> list[int]:
        """Indices of a condition's folds."""
        return [k for k, fold in enumerate(self.dealt) if fold.condition == condition]

    @property
    def repeats(self) -> bool:
        """Whether anything comes again in these runs or others, so that noise is told from what is missed."""
        return self.noise_samples > 0

    @property
    def on_bench(self) -> bool:
        """Whether these are runs of the motor alone, which have the motor's equation and no other."""
        return self.cable_sign == 0

    @property
    def in_contact(self) -> bool:
        """Whether these are runs that press on the load cell."""
        return self.key[1] == "contact"

    @property
    def equations(self) -> int:
        """How many equations its runs have."""
        return 1 if self.on_bench else 3

    @property
    def samples(self) -> int:
        """Decimated samples in the group."""
        return sum(f.samples for f in self.folds)


@dataclass
class Reduced:
    """All that the diagnosis needs of the sessions; ``on_bench``: all runs are of the motor alone."""

    layout: Layout
    groups: list[Group]
    on_bench: bool
    radius: float  # of the pulley, m; 1 on a bench without one


def runs_to_analyse(sessions: Sequence[Session]) -> tuple[list[tuple[Session, Run]], bool]:
    """Finger runs of all sessions and the motor-bench runs beside them; whether there are only the latter.

    Raises:
        UserError: there is no run at all, or finger runs without the finger's constants.
    """
    every = [(s, r) for s in sessions for r in s.runs]
    bench = [(s, r) for s, r in every if r.phase == "motor_bench"]
    finger = [(s, r) for s, r in every if r.phase != "motor_bench" and r.cable_sign != 0]
    if finger:
        for session, _ in finger:
            if session.rig.finger is None:
                raise UserError(f"{session.path} gives no finger constants; its rig text needs 'finger'.")
        return finger + bench, False
    if not bench:
        names = ", ".join(str(s.path) for s in sessions)
        raise UserError(
            f"{names} holds no run with a cable and no motor-bench run; there is nothing to compare."
        )
    return bench, True


def group_key(run: Run) -> GroupKey:
    """Runs of one cable and phase belong together."""
    return (run.cable, kind_of(run.phase))


def kind_of(phase: str) -> str:
    """Second part of a group's key: whether its runs press on something."""
    return "contact" if phase == "contact" else "free"


def deal_runs(runs: Sequence[Run]) -> tuple[dict[GroupKey, list[Fold]], list[int]]:
    """The folds of every group of runs, and for each run which of its group's folds holds it."""
    members: dict[GroupKey, list[int]] = {}
    for number, run in enumerate(runs):
        members.setdefault(group_key(run), []).append(number)
    folds, places = {}, [0] * len(runs)
    for key, mine in members.items():
        folds[key], found = deal([runs[i] for i in mine], FOLDS)
        for i, place in zip(mine, found, strict=True):
            places[i] = place
    return folds, places

"""A wanted force is sent to the bench: practice first, then runs of one model, or of two in random order.

1. The load cell is found, and a slow motion about there (``pose``) tells how finger and motor stand.
2. The nominal model's torque for that pose (``practice``): the first run under torque.
3. Each model's torque along the motion that was measured in 2, once more as practice: from now on its torque
   is found along its own motion, less the constant by which it pressed too hard.
4. The same a few times more, as a fixed-point iteration with Aitken's relaxation: under a torque that is
   learned along one motion a soft cable makes another, and the torque that is learned along that goes back.
   A tip that slides may do so at another moment, too, so that the next torque need not be the better one.
   Each model keeps the mean of those that missed least, which also tell what is left of the constant, and
   how far the found torque is to be gone, as far as it misses less than the nominal one.
5. The runs that count: with two models in pairs, the order within each pair drawn by a seed.

What is worked out between runs is worked out with the amplifier off. It ends on the first doubt: a torque
beyond the limits or too far from the nominal one, a fingertip that does not press, presses too hard or leaves
the load cell, a found model that does worse than the nominal one by far.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.acquisition.control.machine import SetUp
from fingerlab.acquisition.control.trajectories import MOST_FORCE, MOST_POSITION
from fingerlab.acquisition.protocols.steps import Change, Find, Record, Rest, Step, WorkOut, prompt_of
from fingerlab.core.errors import UserError
from fingerlab.core.text import number
from fingerlab.diagnosis.fit.bounded_step import aitken_factor
from fingerlab.models.file import load_model
from fingerlab.prediction.extended import ExtendedModel, Variant, extended_model
from fingerlab.prediction.feed_forward import (
    CORRECTION_SHARE,
    FOUND,
    NOMINAL,
    Feed,
    best_share,
    between,
    first_plan,
    judged_feed,
    learned_plan,
    mean_plan,
    own_error,
    predicted_mean,
    refuse_far,
    shifted_plan,
)
from fingerlab.prediction.inverse import LEAD_S, TorquePlan, needed_torque
from fingerlab.prediction.target import ContactPose, WantedForce, pose_of_run, wanted_force
from fingerlab.prediction.trial import (
    FORCE_MODEL,
    FORCE_TRIAL,
    FOUND_SHARE,
    POSE,
    PRACTICE,
    WANTED_FORCE,
    force_error,
)
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array, Run

LONGEST_S = 20.0
"""Of a wanted force: so long a run is still in the ring when the next torque is learned from it."""
POSE_HZ, POSE_S = 0.5, 6.0
"""The motion that tells the pose: slow, with two whole periods after the start (assumed)."""
HARDER, HARDER_N = 2.0, 0.5
"""A run ends where the fingertip presses with so many times the highest wanted force and so much more, N: a
model that is wrong by a factor of two still shows by how much, and nothing gives way (assumed)."""
FURTHER_DEG = 15.0
"""And where the pulley turns so much further than it has stood under force before, and than the found cable
gives under the torque to come (assumed: far less than a finger needs to slip off the load cell)."""
PRESSES = 0.1
"""Share of the wanted force that a practice run presses with at least, on average; with less there is no
contact (assumed: the thesis' bench had a quarter)."""
PRACTICES = 4
"""Of each model (assumed: from the second on the torque is found along its own motion; sheath and tip that
slide by turns need two or three more to come to rest, or do not)."""
ALIKE = 1.25
"""Practices that miss the force by up to so many times the least are taken together (assumed: more than runs
of one torque differ by, less than a tip that has slid at another moment makes)."""
MOST_TRIM = 0.5
"""Share of the mean wanted force by which each model's own practice may shift its torque's aim (assumed: a
tip that sticks keeps the side force with which it was set down, up to its friction times the force, and no
model knows it; 0.36 was seen. A quarter left constants in either model's error that told of the bound)."""
TRIM_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Of a trim: the first that can be sent is."""
WORSE = 2.0
"""By so many times a found model's practice may miss the force more than the nominal one's worst, before it
is doubted (assumed: by chance a good model does not)."""


def furthest_position_deg(
    position: float, torque: float, most_torque: float, compliance: float, rig: Rig
) -> float:
    """Where a run ends because the pulley has turned too far, deg; what the found cable gives is no slip.

    Args:
        position: rad, where the pulley stood furthest before, under ``torque`` (N m).
        most_torque: N m, the highest to come. compliance: m/N, of the found model's cable.
    """
    radius = rig.motor.pulley_radius or math.inf
    stretch = max(compliance, 0.0) * max(most_torque - torque, 0.0) / radius**2
    furthest = min(position + stretch + math.radians(FURTHER_DEG), rig.limits.position_high)
    return math.degrees(furthest)


@dataclass(frozen=True)
class TrialSettings:
    """What is asked for.

    Attributes:
        model_file: written by ``diagnose --save``. wanted: JSON, or a table of time (s) and force (N).
        pairs: runs of each model; 0: ``runs`` runs of ``variant`` alone.
        seed: of the order. force: N, at which the contact is found. amplitude_deg: of the motion about it.
        rest_s: between runs. correction_share: as ``CORRECTION_SHARE``.
        asks: whether the operator is asked before the first torque is sent.
    """

    model_file: Path
    wanted: str
    pairs: int = 0
    runs: int = 1
    variant: str = FOUND
    seed: int = 0
    force: float = 0.8
    amplitude_deg: float = 2.0
    rest_s: float = 2.0
    correction_share: float = CORRECTION_SHARE
    asks: bool = False


@dataclass(frozen=True)
class Practice:
    """One practice of a model.

    Attributes:
        along: the run along whose motion its torque was found. trim: N, with which it was.
        error: force error, N, (n,). plan: that was sent.
    """

    along: Run
    trim: float
    error: Array
    plan: TorquePlan

    @property
    def missed(self) -> float:
        """N rms, less a constant, which is trimmed away."""
        return float(np.std(self.error))


def best_practices(practices: Sequence[Practice]) -> list[Practice]:
    """Those that missed the force about as little as the best, ``ALIKE``."""
    least = min(practice.missed for practice in practices)
    return [practice for practice in practices if practice.missed <= ALIKE * least]


@dataclass
class ForceTrial:
    """The steps of a trial and what is learned on the way.

    Attributes:
        show: given each model's first torque (by name) before the operator is asked.

    Raises:
        UserError: no such model, a model without effects where two are to be told apart, or a wanted force
            that cannot be.
    """

    settings: TrialSettings
    rig: Rig
    show: Callable[[Mapping[str, TorquePlan]], None] | None = None
    model: ExtendedModel = field(init=False)
    wanted: WantedForce = field(init=False)
    _pose: ContactPose | None = None
    _reached: tuple[float, float] = (0.0, math.inf)
    _plans: dict[str, TorquePlan] = field(default_factory=dict)
    _feeds: dict[str, Feed] = field(default_factory=dict)
    _motions: dict[str, Run] = field(default_factory=dict)
    _practised: dict[str, list[Practice]] = field(default_factory=dict)
    _trims: dict[str, float] = field(default_factory=dict)
    _changes: dict[str, tuple[float, Array]] = field(default_factory=dict)
    _share: float = 1.0

    def __post_init__(self) -> None:
        settings = self.settings
        self._where = str(settings.model_file)
        self.model = extended_model(load_model(settings.model_file), self._where)
        self.wanted = wanted_force(settings.wanted)
        if self.wanted.time[-1] > LONGEST_S:
            raise UserError(
                f"The wanted force lasts {self.wanted.time[-1]:.3g} s; a feed-forward that is learned from "
                f"run to run takes up to {LONGEST_S:g} s."
            )
        if self.wanted.force.max() > self.rig.limits.force:
            raise UserError(
                f"The wanted force reaches {self.wanted.force.max():.3g} N; the rig's limit is "
                f"{self.rig.limits.force:.3g} N."
            )
        if FOUND in self.names and not self.model.effect_ids:
            raise UserError(
                f"{self._where} holds no effect, so that nothing was found; save one with 'fingerlab "
                "diagnose --save', or send the nominal model with '--variant nominal'."
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Models that are sent."""
        return (NOMINAL, FOUND) if self.settings.pairs else (self.settings.variant,)

    @property
    def order(self) -> tuple[str, ...]:
        """Which model each of the runs that count has: pairs, each in an order of its own."""
        if not self.settings.pairs:
            return self.names * self.settings.runs
        rng = np.random.default_rng(self.settings.seed)
        return tuple(
            name for _ in range(self.settings.pairs) for name in rng.permutation(self.names).tolist()
        )

    @property
    def attributes(self) -> dict[str, Any]:
        """Of the session."""
        settings = self.settings
        about = {
            "model": settings.model_file.name, "effects": list(self.model.effect_ids),
            "pairs": settings.pairs, "order": list(self.order), "seed": settings.seed,
            "correction_share": settings.correction_share,
        }  # fmt: skip
        return {FORCE_TRIAL: json.dumps(about)}

    def steps(self) -> tuple[Step, ...]:
        """All of them; torques are filled in as they are learned."""
        settings, set_up = self.settings, SetUp("contact", "flexion")
        models = tuple(dict.fromkeys((NOMINAL, *self.names)))  # the nominal one practises in any case
        learning = (PRACTICES - 1) * [self._learned] + [self._settled]
        practice = [(name, learn) for learn in learning for name in models]
        count = 2 + len(practice) + len(self.order)
        motion = {
            "kind": "sine",
            "amplitude_deg": settings.amplitude_deg,
            "frequency_hz": POSE_HZ,
            "duration_s": POSE_S,
        }
        steps: list[Step] = [Change(set_up, prompt_of(set_up)), Find(settings.force)]
        steps.append(Record(1, count, "contact", "flexion", motion, 0.0, {FORCE_MODEL: POSE}))
        ask = self._ask_first if settings.asks else None
        steps.append(WorkOut("working out the first torque", self._take_pose, ask))
        steps.append(self._record(2, count, PRACTICE, self._first))
        steps.append(WorkOut("learning from the first run", self._learn_first))
        for place, (name, learn) in enumerate(practice, start=3):
            steps.append(self._record(place, count, f"{PRACTICE} {name}", self._planned(name)))
            steps.append(WorkOut(f"learning from the run of the {name} model", learn(name)))
        for place, name in enumerate(self.order, start=3 + len(practice)):
            steps += [Rest(settings.rest_s), self._record(place, count, name, self._fed(name))]
        return tuple(steps)

    def _record(
        self,
        place: int,
        count: int,
        name: str,
        later: Callable[[], tuple[Mapping[str, Any], Mapping[str, Any]]],
    ) -> Record:
        seconds = LEAD_S + float(self.wanted.time[-1])
        empty = {"kind": "torque", "time_s": [0.0, seconds], "torque_n_m": [0.0, 0.0], "ramp_s": 0.0}
        return Record(place, count, "contact", "flexion", empty, 0.0, {FORCE_MODEL: name}, later)

    # what is learned, with the amplifier off

    def _take_pose(self, run: Run) -> None:
        self._pose = pose_of_run(run)
        self._look_how_far(run)
        self._plans[PRACTICE] = self._kept(
            first_plan(self.wanted, self.model, self._pose, self.rig, self._where)
        )

    def _ask_first(self) -> str:
        """Before the first torque: what each model needs for the pose, and what the rig allows."""
        assert self._pose is not None
        plans = {NOMINAL: self._plans[PRACTICE]}
        with suppress(UserError):  # a pose that is a line of the force need not have one; learned torques do
            plans[FOUND] = needed_torque(self.wanted, self.model.extended, self._pose, self.rig, self._where)
        if self.show is not None:
            self.show(plans)
        spans = [
            f"{name} {1e3 * plan.torque.min():.0f} to {1e3 * plan.torque.max():.0f} mN m"
            for name, plan in plans.items()
        ]
        most = 1e3 * plans[NOMINAL].torque_limit
        return (
            f"Look at the torque to come: {', '.join(spans)}; the rig allows {most:.0f} mN m. Done sends it; "
            "later runs are learned from those before, within the same limits."
        )

    def _learn_first(self, run: Run) -> None:
        self._look_at(run)
        for name in dict.fromkeys((NOMINAL, *self.names)):
            self._motions[name] = run
            self._plans[name] = self._learn(name, run)
        for name, plan in self._plans.items():
            if name in (NOMINAL, FOUND):
                self._judge(name, plan, run)

    def _learned(self, name: str) -> Callable[[Run], None]:
        """Of a model's practice: its motion, along which its next torque is found."""

        def learn(run: Run) -> None:
            self._look_at(run)
            self._doubt(name, run)
            predicted = predicted_mean(self._variant(name), self._plans[name], run, self.rig, self._where)
            pressed = float(force_error(run, self.wanted).measured.mean())
            self._trims[name] = self._bound(predicted - pressed)
            self._motions[name] = run
            self._plans[name] = self._relaxed(name, self._plans[name], self._learn(name, run))
            self._judge(name, self._plans[name], run)

        return learn

    def _settled(self, name: str) -> Callable[[Run], None]:
        """Of its last: what is sent, the mean of what practised well, and how far the found torque goes."""

        def settle(run: Run) -> None:
            self._look_at(run)
            self._doubt(name, run)
            plan = self._mean_of_best(name)
            if name == FOUND:
                self._share = best_share(self._best_error(NOMINAL), self._best_error(FOUND))
                plan = self._kept(between(self._plans[NOMINAL], plan, self._share, self.rig))
            self._judge(name, plan, self._motions[name])
            self._plans[name] = plan

        return settle

    def _mean_of_best(self, name: str) -> TorquePlan:
        """The mean torque of a model's best practices, trimmed by what each still missed."""
        plans, trims = [], []
        for practice in best_practices(self._practised[name]):
            self._motions[name] = practice.along
            self._trims[name] = practice.trim
            before = self._learn(name, practice.along)
            self._trims[name] = self._bound(practice.trim - float(practice.error.mean()))
            after = self._learn(name, practice.along)
            plans.append(shifted_plan(practice.plan, after.torque - before.torque, self.rig))
            trims.append(self._trims[name])
        self._trims[name] = float(np.mean(trims))
        return self._kept(mean_plan(plans, self.rig))

    def _relaxed(self, name: str, sent: TorquePlan, learned: TorquePlan) -> TorquePlan:
        """The next torque of a model's practice: on the way from the one that was sent to what it taught."""
        change = learned.torque - sent.torque
        factor = aitken_factor(self._changes.get(name), change)
        self._changes[name] = factor, change
        return self._kept(between(sent, learned, factor, self.rig))

    def _best_error(self, name: str) -> Array:
        """Force error that a model's best practices have in common, N, (n,)."""
        errors = [practice.error for practice in best_practices(self._practised[name])]
        length = min(map(len, errors))
        return np.asarray(np.mean([error[:length] for error in errors], axis=0))

    def _bound(self, trim: float) -> float:
        most = MOST_TRIM * float(self.wanted.force.mean())
        return float(np.clip(trim, -most, most))

    def _learn(self, name: str, run: Run) -> TorquePlan:
        """A model's torque along the motion of ``run``, trimmed as far as cable and rig allow.

        A trim is a help: a model that is far off may need a cable that pushes for all of it.
        """
        assert self._pose is not None
        variant, trim = self._variant(name), self._trims.get(name, 0.0)
        for share in TRIM_SHARES if trim else (0.0,):
            applied = share * trim
            plan = learned_plan(variant, self.wanted, run, self._pose, self.rig, self._where, applied)
            if not plan.beyond:
                break
        self._trims[name] = applied
        return self._kept(plan)

    def _variant(self, name: str) -> Variant:
        return self.model.nominal if name == NOMINAL else self.model.extended

    def _judge(self, name: str, plan: TorquePlan, run: Run) -> None:
        trim = self._trims.get(FOUND, 0.0)
        feed = judged_feed(name, self.model, plan, self._plans[NOMINAL], run, self.rig, self._where, trim)
        refuse_far(feed, self.settings.correction_share)
        self._feeds[name] = feed

    def _look_at(self, run: Run) -> None:
        """Raises UserError where the fingertip has hardly pressed."""
        self._look_how_far(run)
        start = round(LEAD_S * run.sample_rate_hz)
        pressed, asked = (
            float(np.mean(run.channel("endpoint_force")[start:])),
            float(self.wanted.force.mean()),
        )
        if pressed < PRESSES * asked:
            raise UserError(
                f"The fingertip pressed with {number(pressed, 2)} N on average where {number(asked, 2)} N "
                "were wanted; look whether the cable is tight and the finger meets the load cell."
            )

    def _look_how_far(self, run: Run) -> None:
        position = run.channel("motor_position")
        furthest = int(np.argmax(position))
        self._reached = float(position[furthest]), float(run.channel("motor_torque")[furthest])

    def _doubt(self, name: str, run: Run) -> None:
        """Keep a practice; raises UserError where the found model's was far worse than the nominal one's."""
        error = force_error(run, self.wanted).error
        practice = Practice(self._motions[name], self._trims.get(name, 0.0), error, self._plans[name])
        self._practised.setdefault(name, []).append(practice)
        nominal, found = max(one.missed for one in self._practised[NOMINAL]), practice.missed
        if name == FOUND and found > WORSE * np.fmax(nominal, own_error(self.model)):
            raise UserError(
                f"With the found model the force is missed by {1e3 * found:.0f} mN, with the nominal one by "
                f"up to {1e3 * nominal:.0f} mN; the model does not fit the bench as it stands: record and "
                "diagnose it anew."
            )

    @staticmethod
    def _kept(plan: TorquePlan) -> TorquePlan:
        """Raises UserError where the rig's limits are not kept."""
        if plan.beyond:
            raise UserError(plan.beyond[0])
        return plan

    # what is sent

    def _first(self) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
        return self._bounded(self._plans[PRACTICE]), self._force_attributes()

    def _planned(self, name: str) -> Callable[[], tuple[Mapping[str, Any], Mapping[str, Any]]]:
        return lambda: (self._bounded(self._plans[name]), self._force_attributes())

    def _fed(self, name: str) -> Callable[[], tuple[Mapping[str, Any], Mapping[str, Any]]]:
        def fed() -> tuple[Mapping[str, Any], Mapping[str, Any]]:
            feed = self._feeds[name]
            about = {
                "foretold_rms_n": feed.predicted_rms,
                "correction_n_m": feed.correction,
                "trim_n": self._trims.get(name, 0.0),
                FOUND_SHARE: self._share if name == FOUND else 0.0,
            }
            return self._bounded(self._plans[name]), {**self._force_attributes(), **about}

        return fed

    def _bounded(self, plan: TorquePlan) -> Mapping[str, Any]:
        force = min(HARDER * float(self.wanted.force.max()) + HARDER_N, self.rig.limits.force)
        compliance = self.model.extended.values.get("cable_compliance", 0.0)
        furthest = furthest_position_deg(*self._reached, float(plan.torque.max()), compliance, self.rig)
        return {**plan.trajectory(), MOST_FORCE: force, MOST_POSITION: furthest}

    def _force_attributes(self) -> dict[str, Any]:
        """The wanted force with each run, 50 points a second: the file needs no other beside it."""
        step = 5
        points = [round(float(force), 4) for force in self.wanted.force[::step]]
        apart = step * float(self.wanted.time[1] - self.wanted.time[0])
        return {WANTED_FORCE: json.dumps({"lead_s": LEAD_S, "step_s": apart, "force_n": points})}

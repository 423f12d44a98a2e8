"""Which sessions the goldens are taken from, how each is made, and what is asked of it.

Names, seeds and effects' strengths are fixed here. Nothing of the program is imported, so that a golden means
the same session before and after any change of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.hidden.sweep.trials import Trial, nothing, outside, pairs, singles

EFFECTS = [
    "added_mass",
    "angle_sensor_nonlinearity",
    "asymmetric_friction",
    "backlash",
    "cable_slack",
    "cable_stretch",
    "capstan_friction",
    "contact_angle",
    "contact_compliance",
    "coulomb_friction",
    "distal_rotation",
    "gravity_tilt",
    "joint_coupling",
    "joint_stop",
    "load_cell_gain",
    "load_dependent_friction",
    "motor_coulomb_friction",
    "motor_inertia",
    "motor_presliding",
    "motor_spring",
    "motor_stribeck_friction",
    "motor_viscous_friction",
    "presliding_hysteresis",
    "routing_change",
    "sensor_drift",
    "spring_hardening",
    "stiffness_error",
    "stribeck_friction",
    "torque_ripple",
    "transport_delay",
    "varying_moment_arm",
    "viscoelastic_creep",
    "viscous_friction",
]
NOT_IN_ENGINE = {"backlash", "motor_presliding", "routing_change", "varying_moment_arm"}
SEEDS = (101, 102)

ALWAYS = ("diagnose", "sums", "fit", "predict")
"""Asked of every session."""
NOW_AND_THEN = ("info", "compare", "inverse", "added", "variants")
"""Asked of recordings and of every fifth session; two of three recordings do without in the quick part."""
REPORT_EVERY = 10
QUICK_REPORTS = ("bench-coulomb", "real-seal", "sealed-4")
QUICK_ENGINE = 4


@dataclass(frozen=True)
class Item:
    """One session, or two that are read together.

    Attributes:
        name: of its golden. kind: of the session. steps: what is asked of it (see ``taking.STEPS``).
        quick: which of the steps belong to the quick part; empty: the session does not.
        simulate: words for ``fingerlab simulate`` but ``--out``; None: not made by it.
        engine: effects and seed for the second engine. recording: file that somebody else made.
        left_out: effects that the catalogue is to be without. proposed: the proposed run is read, too.
    """

    name: str
    kind: str
    steps: tuple[str, ...]
    quick: tuple[str, ...] = ()
    simulate: tuple[str, ...] | None = None
    engine: tuple[tuple[str, ...], int] | None = None
    recording: Path | None = None
    left_out: tuple[str, ...] = ()
    proposed: bool = False

    def of(self, part: str) -> tuple[str, ...]:
        """The steps of ``quick`` or ``all``."""
        return self.quick if part == "quick" else self.steps


def recordings(folder: Path) -> Iterator[Item]:
    """Every session file of a folder, and its text files as one session of two runs in contact."""
    for number, path in enumerate(sorted(folder.glob("*.h5"))):
        some = NOW_AND_THEN if number % 3 == 0 else ()
        report = ("report",) if path.stem in QUICK_REPORTS else ()
        quick = (*ALWAYS, *some, *report)
        yield Item(path.stem, "recording", (*ALWAYS, *NOW_AND_THEN, "report"), quick, recording=path)
    if any(folder.glob("*.txt")):
        steps = (*ALWAYS, "info", "variants")
        yield Item("text", "recording", steps, steps, recording=folder)


def sweep() -> Iterator[Item]:
    """The sessions of all kinds, some 300 in a fixed order: half of it is half of every kind."""
    kinds: dict[str, list[Item]] = {
        "rich": _twin("rich", [*singles("twin", "rich", EFFECTS, SEEDS)]),
        "thesis": _twin("thesis", [*singles("twin", "thesis", EFFECTS, SEEDS)]),
        "pairs": _twin("pairs", [*pairs("twin", EFFECTS, 40, 3000)]),
        "outside": _twin("outside", [*outside("twin", EFFECTS, SEEDS[:1])]),
        "plain": _plain(),
        "engine": _engine(),
        "proposed": _proposed(),
        "parts": _parts(),
    }
    found = []
    for kind, items in kinds.items():
        chosen = _evenly(len(items), QUICK_ENGINE if kind == "engine" else 3)
        for number, item in enumerate(items):
            found.append((number / len(items), _with_steps(item, number, number in chosen)))
    for _, item in sorted(found, key=lambda one: one[0]):
        yield item


def _with_steps(item: Item, number: int, quick: bool) -> Item:
    steps: tuple[str, ...] = ("left_out",) if item.left_out else ALWAYS
    if not item.left_out and number % 5 == 0:
        steps = (*steps, *NOW_AND_THEN)
    some = steps if number == 0 else steps[: len(ALWAYS)]
    if not item.left_out and number % REPORT_EVERY == 0:
        steps = (*steps, "report")
    return Item(**{**vars(item), "steps": steps, "quick": some if quick else ()})


def _evenly(count: int, wanted: int) -> set[int]:
    return {round(k * count / wanted) for k in range(wanted)}


def _name(kind: str, trial: Trial) -> str:
    return "-".join([kind, *(trial.effects or ("plain",)), str(trial.seed)])


def _words(trial: Trial) -> tuple[str, ...]:
    told = zip(trial.effects, trial.strengths, strict=True)
    effects = [word for name, k in told for word in ("--effect", f"{name}=x{k:.4f}")]
    return ("--protocol", trial.protocol, *effects, "--seed", str(trial.seed))


def _twin(kind: str, trials: list[Trial]) -> list[Item]:
    return [Item(_name(kind, t), kind, (), simulate=_words(t), left_out=t.left_out) for t in trials]


def _plain() -> list[Item]:
    rich = _twin("plain-rich", [*nothing("twin", "rich", range(1000, 1008))])
    return rich + _twin("plain-thesis", [*nothing("twin", "thesis", range(2000, 2008))])


def _engine() -> list[Item]:
    ids = [name for name in EFFECTS if name not in NOT_IN_ENGINE]
    trials = [*singles("engine", "rich", ids, SEEDS), *nothing("engine", "rich", SEEDS)]
    return [Item(_name("engine", t), "engine", (), engine=(t.effects, t.seed)) for t in trials]


def _proposed() -> list[Item]:
    """Sessions after which the diagnosis proposes a run."""
    trials = [*singles("twin", "thesis", ["gravity_tilt", "added_mass", "joint_coupling"], SEEDS[1:])]
    return [Item(_name("proposed", t), "proposed", (), simulate=_words(t), proposed=True) for t in trials]


def _parts() -> list[Item]:
    """The protocols that are parts of the others, and the motor alone."""
    found = []
    for protocol, effects in {
        "motor-bench": ("motor_coulomb_friction", "motor_spring", "torque_ripple", "load_dependent_friction"),
        "on-air": ("coulomb_friction", "cable_stretch", "joint_stop", "viscoelastic_creep"),
        "contact": ("capstan_friction", "contact_compliance", "load_cell_gain", "routing_change"),
    }.items():
        for seed, one in enumerate((*effects, None), start=501):
            words = ("--effect", one) if one else ()
            name = f"{protocol}-{one or 'plain'}-{seed}"
            simulate = ("--protocol", protocol, *words, "--seed", str(seed))
            found.append(Item(name, protocol, (), simulate=simulate))
    return found

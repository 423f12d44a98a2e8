"""The page of the bench as built: what each cause does, what was found, and one session's story."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fingerlab.diagnosis.settings import ARM_RATIO_SPREADS, USUAL_RATIOS, USUAL_SPREAD
from fingerlab.effects import CATALOGUE
from fingerlab.twin.protocols import Preset

SHEATH = "capstan_friction"
FAMILIES = {"joint_torque": ("joint torque", "mN m", 1e3), "endpoint_force": ("endpoint force", "N", 1.0)}
WANTED_FLOORS, WANTED_PEAK = 1.5, 0.10
"""An error of so many floors at most counts as explained; so near 1 the share of the peak force."""
PROTOCOLS = {"thesis": "the thesis' protocol", "rich": "the rich protocol"}

INTRODUCTION = """\
The thesis' model gave a quarter of the endpoint force that the load cell read (27 %). The simulated bench
as it was probably built shows the same ([the thesis' experiment](replicate.md)), and there every cause is
known: `resources/rigs/as-built.toml` holds the effects that it lists, what its other numbers amount to
(friction times bend of the sheath, two cables whose arms differ more than is usual), and what its rig file
leaves out (the motor's inertia)."""
CAUSES = """\
One cause at a time is taken away from the bench, the thesis' runs are taken on what is left (seed 1, two of
12 s on air, two in contact), and the thesis' analysis gives the peak force as a share of the measured one.
With all of them it gives {now}. No single one makes the quarter; what raises the share most stands first.
Below zero, and "–": on such a bench the runs on air give arms of the wrong sign, or none. The motor's
inertia was not taken away."""
FOUND = """\
Nobody tells the diagnosis: it gets the recording and the rig file, and what it names is held against the
preset. Errors are rms on runs left out of the fit, of the nominal model and of the model at the end of
the path, both under the weights of the better one; a floor follows the arms and the delay that a model
has found, so compare N m and N from model to model. The thesis' parameters come from the runs on air
alone (PIP equation, extension region, delay by findsignal 10 %) and predict the contact runs with the
dorsal cable's arms. The nominal model beside it is fitted to all runs but the one that it predicts,
contact included: its arms make up for much of what it lacks, so that its peak is near while its course is
not."""

Row = dict[str, Any]


def held_by(preset: Preset) -> frozenset[str]:
    """Effects that a preset holds: those that it names, and what its numbers and gaps amount to."""
    n = preset.numbers
    ratios = [b / a for a, b in zip(n["arms"]["extension"], n["arms"]["flexion"], strict=True)]
    off = [math.log(r / u) / USUAL_SPREAD for r, u in zip(ratios, USUAL_RATIOS, strict=True)]
    numbers = {
        "capstan_friction": any(n["cable"]["wrap"]),
        "cable_slack": n["cable"]["slack"] > 0,
        "viscous_friction": any(n["joints"]["viscous"]),
        "motor_viscous_friction": n["motor"]["viscous"] > 0,
        "motor_inertia": n["motor"]["inertia"] > 0 and preset.rig.motor.inertia is None,
        "routing_change": math.hypot(*off) > ARM_RATIO_SPREADS,
    }
    return frozenset(preset.effects) | {name for name, held in numbers.items() if held}


def path_of(row: Row) -> list[str]:
    """Ids of the effects that were found, in order."""
    return [name for name, _ in row.get("path", [])[1:]]


def floors(part: Row, family: str) -> float:
    """RMS error in floors; infinite where the session has no such equation."""
    error, floor = part["errors"].get(family, (math.inf, 1.0))
    return float(error / floor)


def figures(rows: Sequence[Row], held: frozenset[str]) -> list[tuple[str, str]]:
    """What was counted, and how often."""
    good = [row for row in rows if "failed" not in row]

    def share(hit: Callable[[Row], bool]) -> str:
        return f"{sum(hit(row) for row in good)} of {len(rows)}"

    def near(row: Row) -> bool:
        known = row["found"]["share"]
        return known is not None and abs(known - 1) <= WANTED_PEAK

    return [
        ("sheath friction in the path", share(lambda row: SHEATH in path_of(row))),
        (
            "nothing in the path that the preset does not hold",
            share(lambda row: bool(path_of(row)) and set(path_of(row)) <= held),
        ),
        *(
            (
                f"{title} at most {WANTED_FLOORS} floors at the end of the path",
                share(lambda row, name=name: floors(row["found"], name) <= WANTED_FLOORS),
            )
            for name, (title, _, _) in FAMILIES.items()
        ),
        ("peak force within 10 % of the measured one, runs left out", share(near)),
    ]


def said_path(row: Row) -> str:
    """The path in ids, each with the score that it leaves, in floors."""
    steps = [f"`{name}` {score:.3g}" if name else f"{score:.3g}" for name, score in row["path"]]
    return " → ".join(steps)


def _error(part: Row, family: str) -> str:
    if family not in part["errors"]:
        return "–"
    return f"{part['errors'][family][0] * FAMILIES[family][2]:.3g} ({floors(part, family):.1f})"


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.0f} %"


def table(rows: Sequence[Row], held: frozenset[str]) -> list[str]:
    """One line for each session."""
    lines = [
        "| protocol | seed | path, and score after each effect | not in the preset "
        "| joint torque before, after: mN m (floors) | endpoint force before, after: N (floors) "
        "| peak force over measured: thesis' parameters | nominal model | model found |",
        "|---|---:|---|---|---|---|---:|---:|---:|",
    ]
    for row in rows:
        if "failed" in row:
            lines.append(f"| {row['protocol']} | {row['seed']} | failed: {row['failed'][:80]} |" + " – |" * 6)
            continue
        others = ", ".join(f"`{name}`" for name in path_of(row) if name not in held) or "–"
        errors = [" → ".join(_error(row[part], name) for part in ("nominal", "found")) for name in FAMILIES]
        shares = [row["thesis_share"], row["nominal"]["share"], row["found"]["share"]]
        cells = [row["protocol"], str(row["seed"]), said_path(row), others, *errors, *map(_share, shares)]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def causes(preset: Preset) -> Mapping[str, str]:
    """What each effect that the preset holds does there, in words with the preset's numbers."""
    n, of = preset.numbers, preset.effects
    wrap, inertia = n["cable"]["wrap"][0], n["motor"]["inertia"]
    (a, b), (c, d) = ([1e3 * arm for arm in n["arms"][cable]] for cable in ("extension", "flexion"))
    lost, held = 100 * (1 - math.exp(-wrap)), 100 * (math.exp(wrap) - 1)
    lean, loose = -math.degrees(of["contact_angle"]["angle"]), 1e3 * of["cable_slack"]["travel"]
    soft, late = 1e3 * of["cable_stretch"]["compliance"], 1e3 * of["transport_delay"]["delay"]
    dry, wet = 1e3 * of["coulomb_friction"]["mcp"], 1e3 * of["viscous_friction"]["mcp"]
    gear, grease = of["motor_coulomb_friction"]["torque"], of["motor_viscous_friction"]["coefficient"]
    mesh, order = 1e3 * of["torque_ripple"]["torque"], of["torque_ripple"]["order"]
    return {
        SHEATH: f"""on the back of the hand the cable bends over glove and knuckles, friction times bend
            {wrap:.2f}: winding in, {lost:.0f} % of the motor's pull is lost on the way to the finger; paying
            out, the finger holds {held:.0f} % more than the motor feels. Arms that are fitted on air without
            it are those of a cable that loses nothing""",
        "routing_change": f"""the palmar cable stands {c:.1f} and {d:.1f} mm off MCP and PIP, the dorsal one
            {a:.1f} and {b:.1f} mm; who takes the dorsal arms for the palmar cable, as the thesis did, gives
            every newton of it {d / b:.1f} times too little torque at the PIP""",
        "contact_angle": f"""the load cell's face leans by {lean:.0f} degrees, so that the force passes nearer
            to the PIP joint and the same torque presses harder""",
        "cable_slack": f"{loose:.1f} mm of cable hang loose: the pulley turns and nothing pulls",
        "cable_stretch": f"""the glove gives by {soft:.1f} mm for each newton, so that the pulley turns
            further than the joints""",
        "transport_delay": f"""angles and force are recorded {late:.0f} ms later than the motor's channels,
            which looks like friction or mass""",
        "motor_inertia": f"""rotor, gearbox and pulley ({inertia:.1e} kg m² at the output) take a part of the
            torque when they speed up, and the rig file says nothing of them""",
        "motor_coulomb_friction": f"""motor and gearbox keep {1e3 * gear:.1f} mN m for themselves, whichever
            way they turn""",
        "motor_viscous_friction": f"grease takes {1e3 * grease:.2f} mN m for each rad/s at the output",
        "torque_ripple": f"gear mesh and commutation add {mesh:.2f} mN m, {order:.0f} times in a turn",
        "coulomb_friction": f"""the MCP hinge holds {dry:.1f} mN m against any motion, as much as
            {dry / a:.2f} N of the dorsal cable""",
        "viscous_friction": f"the MCP hinge takes {wet:.2f} mN m for each rad/s",
    }


def _does(name: str, preset: Preset) -> str:
    """What an effect does, in a clause."""
    told = causes(preset).get(name, CATALOGUE[name].explanation.rstrip("."))
    return " ".join(told.split())


def _title(name: str) -> str:
    return CATALOGUE[name].title.lower().replace("mcp", "MCP").replace("pip", "PIP")


def causes_table(without: Mapping[str, float | None], preset: Preset) -> list[str]:
    """What each cause does, and what share of the peak the thesis' analysis gives on a bench without it."""
    lines = ["| in the preset | thesis' share without it | what it does |", "|---|---:|---|"]
    shares = [(without.get(name), name) for name in sorted(held_by(preset))]
    for _, name in sorted(shares, key=lambda one: math.inf if one[0] is None else -one[0]):
        does = _does(name, preset)
        lines.append(f"| `{name}` | {_share(without.get(name))} | {does[0].upper()}{does[1:]}. |")
    return lines


def found_table(rows: Sequence[Row], held: frozenset[str]) -> list[str]:
    """How often, and how early, each effect was found: those of the preset first."""
    good = [row for row in rows if "failed" not in row]
    protocols = [name for name in PROTOCOLS if any(row["protocol"] == name for row in good)]
    found = "".join(f" found, {name} |" for name in protocols)
    lines = [f"| effect | in the preset |{found}", f"|---|---|{'---:|' * len(protocols)}"]
    seen = {name for row in good for name in path_of(row)}
    for name in sorted({*held, *seen}, key=lambda one: (one not in held, list(CATALOGUE).index(one))):
        cells = []
        for protocol in protocols:
            paths = [path_of(row) for row in good if row["protocol"] == protocol]
            places = [path.index(name) + 1 for path in paths if name in path]
            place = f", place {np.median(places):.3g}" if places else ""
            cells.append(f"{len(places)} of {len(paths)}{place}")
        lines.append(f"| `{name}` | {'yes' if name in held else 'no'} | {' | '.join(cells)} |")
    return lines


def told_story(row: Row, preset: Preset) -> list[str]:
    """One session's path, cause by cause, and what is still off at its end."""
    held, steps = held_by(preset), row["steps"]
    names, scores = path_of(row), [score for _, score in row["path"]]
    lines = [
        "| after | score | joint torque: mN m (floors) | endpoint force: N (floors) | peak over measured |",
        "|---|---:|---:|---:|---:|",
    ]
    for name, score, step in zip(["nominal model", *names], scores, steps, strict=True):
        errors = " | ".join(_error(step, family) for family in FAMILIES)
        lines.append(f"| {name} | {score:.3g} | {errors} | {_share(step['share'])} |")
    lines.append("")
    for k, name in enumerate(names):
        does = _does(name, preset) if name in held else "not in the preset: here it stands for another"
        before, after = (part["errors"]["joint_torque"][0] * 1e3 for part in steps[k : k + 2])
        force = [part["errors"].get("endpoint_force", [math.nan])[0] for part in steps[k : k + 2]]
        lines.append(
            f"{k + 1}. **{CATALOGUE[name].title}**: {does}. With it the joint torque's error goes from "
            f"{before:.3g} to {after:.3g} mN m, the force's from {force[0]:.3g} to {force[1]:.3g} N."
        )
    return [*lines, "", *still_off(row, held)]


def still_off(row: Row, held: frozenset[str]) -> list[str]:
    """What a session's model does not explain, and what it should have named."""
    found, path = row["found"], path_of(row)
    many = [
        f"{name.replace('_', ' ')} {floors(found, name):.1f} floors"
        for name in found["errors"]
        if floors(found, name) > WANTED_FLOORS
    ]
    unseen = [_title(name) for name in CATALOGUE if name in held and name not in path]
    wrong = [_title(name) for name in path if name not in held]
    return [
        f"Still off: {', '.join(many) or f'no equation misses more than {WANTED_FLOORS} floors'}. The peak "
        f"force is {_share(found['share'])} of the measured one. In the preset and not named: "
        f"{', '.join(unseen) or 'nothing'}. Named and not in the preset: {', '.join(wrong) or 'nothing'}."
    ]


def markdown(
    rows: Sequence[Row], asked: int, without: Mapping[str, float | None], preset: Preset, command: str
) -> str:
    """The page. ``without``: as of :func:`shares_without`, may be empty."""
    held = held_by(preset)
    parts = [
        f"# Why the force was four times too low\n\nMade by\n\n    {command}\n\n"
        f"It holds {len(rows)} of the {asked} sessions asked for.",
        INTRODUCTION,
    ]
    if without:
        now = _share(without[""])
        parts += ["## The causes", CAUSES.format(now=now), "\n".join(causes_table(without, preset))]
    parts += [
        "## What was found",
        FOUND,
        "\n".join(["| what | sessions |", "|---|---|", *(f"| {a} | {b} |" for a, b in figures(rows, held))]),
        "\n".join(found_table(rows, held)),
        "## Session by session",
        "\n".join(table(rows, held)),
    ]
    for row in rows:
        if "steps" in row:
            parts += [
                f"## Cause by cause: {PROTOCOLS[row['protocol']]}, seed {row['seed']}",
                "Each line is a model of its own: with the effects so far, each of the shape that it has in "
                "the whole model, all numbers fitted anew and judged on runs left out, under the weights of "
                "the best. The score is that of the path.",
                "\n".join(told_story(row, preset)),
            ]
    return "\n\n".join(parts) + "\n"

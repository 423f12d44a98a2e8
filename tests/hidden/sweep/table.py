"""From the trials' results to figures, a table by effect and a confusion table."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from fingerlab.effects import CATALOGUE

Entry = dict[str, Any]

NEIGHBOURS: tuple[frozenset[str], ...] = (
    frozenset({"coulomb_friction", "stribeck_friction", "presliding_hysteresis"}),
    frozenset({"viscous_friction", "viscoelastic_creep", "presliding_hysteresis"}),
    frozenset(
        {"motor_coulomb_friction", "motor_stribeck_friction", "motor_presliding", "asymmetric_friction"}
    ),
    frozenset(
        {"load_dependent_friction", "capstan_friction", "motor_coulomb_friction", "motor_stribeck_friction"}
    ),
    frozenset({"motor_viscous_friction", "viscous_friction"}),
    frozenset({"spring_hardening", "stiffness_error", "joint_stop", "joint_coupling", "varying_moment_arm"}),
    frozenset({"gravity_tilt", "added_mass", "stiffness_error", "motor_spring"}),
    frozenset({"motor_inertia", "distal_rotation", "added_mass", "motor_spring"}),
    frozenset({"cable_slack", "cable_stretch", "backlash", "transport_delay", "motor_presliding"}),
    frozenset({"angle_sensor_nonlinearity", "sensor_drift", "varying_moment_arm"}),
    frozenset({"contact_angle", "load_cell_gain", "routing_change", "contact_compliance"}),
    frozenset({"torque_ripple", "motor_spring"}),
    frozenset({"viscoelastic_creep", "sensor_drift", "spring_hardening", "stiffness_error"}),
)
"""Effects that act alike on a bench (the usual families): who may stand in for whom."""
IN_A_FAMILY = frozenset().union(*NEIGHBOURS)


def near(first: str, second: str) -> bool:
    """Whether two effects are physical neighbours; of an effect in none of the families, its file says so."""
    if {first, second} <= IN_A_FAMILY:
        return any({first, second} <= family for family in NEIGHBOURS)
    return second in _alike(first) or first in _alike(second)


def _alike(name: str) -> tuple[str, ...]:
    found = CATALOGUE.get(name)
    return () if found is None or found.formula is None else found.formula.alike


def kind(entry: Entry) -> str:
    trial = entry["trial"]
    where = trial["protocol"] if trial["source"] == "twin" else "engine"
    if trial["left_out"]:
        return "outside"
    return {0: f"{where}: nothing", 1: f"{where}: one effect"}.get(len(trial["effects"]), "pairs")


def is_first(told: Entry, truth: Sequence[str]) -> bool:
    return told.get("verdict") == "missing_effect" and told["first"] in truth


def in_set(told: Entry, truth: Sequence[str]) -> bool:
    """Whether the truth is in the set: of what is missing, or of what could not have shown."""
    return bool(set(truth) & set(told.get("set", ())))


def in_found_set(told: Entry, truth: Sequence[str]) -> bool:
    """The same where the verdict is that an effect is missing."""
    return told.get("verdict") == "missing_effect" and in_set(told, truth)


def both_found(told: Entry, truth: Sequence[str]) -> bool:
    return set(truth) <= {added for added, _ in told.get("path", [])}


def rightly_strange(told: Entry, missing: str) -> bool:
    if told.get("verdict") == "missing_effect":
        return any(near(missing, one) for one in told["set"])
    return bool(told.get("verdict") == "not_in_catalogue")


def _share(hits: Iterable[bool]) -> str:
    known = list(hits)
    return f"{sum(known)} of {len(known)} ({100 * np.mean(known):.0f} %)" if known else "-"


Rows = list[tuple[str, str]]


def figures(entries: Sequence[Entry]) -> Rows:
    """What was measured, and the figure."""
    by_kind: dict[str, list[Entry]] = defaultdict(list)
    for entry in entries:
        by_kind[kind(entry)].append(entry)
    rows: Rows = []
    for name, group in sorted(by_kind.items()):
        if name.endswith("nothing"):
            alarms = _share(g.get("verdict") != "nothing_missing" for g in group)
            rows.append((f"{name}: false alarms", alarms))
        elif name == "outside":
            right = _share(rightly_strange(g, g["trial"]["effects"][0]) for g in group)
            rows.append(("outside the catalogue: called so, or a neighbour", right))
        elif name == "pairs":
            rows.append(("pairs: both found", _share(both_found(g, g["trial"]["effects"]) for g in group)))
            rows.append(
                ("pairs: first step right", _share(is_first(g, g["trial"]["effects"]) for g in group))
            )
        else:
            rows += _singles(name, group)
    return rows + covered(entries) + calibration(entries)


def _singles(name: str, group: Sequence[Entry]) -> Rows:
    """Figures of sessions with one effect."""
    pairs = [(g, g["trial"]["effects"]) for g in group]
    sizes = [len(g["set"]) for g in group if g.get("set")]
    rows = [
        (f"{name}: first", _share(is_first(g, t) for g, t in pairs)),
        (f"{name}: in the set", _share(in_set(g, t) for g, t in pairs)),
        (
            f"{name}: in the set, and the verdict is a missing effect",
            _share(in_found_set(g, t) for g, t in pairs),
        ),
        (f"{name}: median set", f"{np.median(sizes):g}" if sizes else "-"),
    ]
    left = [g["path"][1][1] for g, t in pairs if is_first(g, t) and len(g["path"]) > 1]
    if left:
        low = 100 * np.mean(np.array(left) <= 1.3)
        rows.append((f"{name}: score with it, median / at most 1.3", f"{np.median(left):.2f} / {low:.0f} %"))
    if any(g["trial"]["proposed"] for g in group):
        rows += _after(name, pairs)
    return rows


def _after(name: str, pairs: Sequence[tuple[Entry, Sequence[str]]]) -> Rows:
    """What one proposed experiment brought."""
    followed = [(g.get("after", g), t) for g, t in pairs]
    taken = [(g, t) for g, t in pairs if "after" in g]
    open_before = [t for g, t in pairs if g.get("set") != list(t)]
    rows = [
        (f"{name}: first after one proposed experiment", _share(is_first(g, t) for g, t in followed)),
        (f"{name}: in the set after it", _share(in_set(g, t) for g, t in followed)),
        (f"{name}: proposed where the truth did not stand alone", f"{len(taken)} of {len(open_before)}"),
        (f"{name}: the truth alone in the set after it", _share(alone(g, t) for g, t in followed)),
        (
            f"{name}: ... of those taken, where it was not alone before",
            _share(alone(g["after"], t) for g, t in taken),
        ),
    ]
    told = [both for g, _ in taken if (both := told_of_truth(g)) is not None]
    if told:
        rows.append(
            (
                f"{name}: gain foretold of the truth within a factor of two",
                _share(well_told(*t) for t in told),
            )
        )
    return rows


def alone(said: Entry, truth: Sequence[str]) -> bool:
    """Whether the set holds the truth and nothing else."""
    return list(said.get("set", [])) == list(truth)


LITTLE = math.log(2.0)
"""Nats; what does not double the odds is no gain, and a ratio of such gains says nothing."""


def told_of_truth(entry: Entry) -> tuple[float, float] | None:
    """Gain foretold of the truth, and as it came in the answers' probabilities, nats; None: none was told."""
    follow, truth = entry.get("after", {}), entry["trial"]["effects"][0]
    told = follow.get("proposal", {}).get("expected_if", {})
    return (told[truth], follow["gained"]) if truth in told and follow["gained"] is not None else None


def well_told(foretold: float, gained: float) -> bool:
    """Within a factor of two, or both less than makes a run worth taking."""
    return foretold / 2.0 <= gained <= 2.0 * foretold or max(abs(foretold), abs(gained)) < LITTLE


def covered(entries: Sequence[Entry]) -> Rows:
    """Held-out force inside the 90 % interval of the final model, by protocol."""
    by_protocol: dict[str, list[float]] = defaultdict(list)
    for entry in entries:
        if entry.get("coverage"):
            by_protocol[kind(entry).split(":")[0]].append(entry["coverage"]["share"])
    rows = []
    for name, shares in sorted(by_protocol.items()):
        inside = _share(0.85 <= share <= 0.95 for share in shares)
        rows.append(
            (
                f"{name}: force inside its 90 % interval, mean; sessions with 85 to 95 %",
                f"{100 * np.mean(shares):.1f} %; {inside}",
            )
        )
    return rows


BINS = ((0.0, 0.6), (0.6, 0.85), (0.85, 0.97), (0.97, 0.995), (0.995, 1.001))


def answers(entries: Sequence[Entry]) -> list[tuple[float, bool]]:
    """The probability of each answer given, and whether it was right; the catalogue complete."""
    said: list[tuple[float, bool]] = []
    for entry in entries:
        if "verdict" not in entry or entry["trial"]["left_out"]:
            continue
        truth = entry["trial"]["effects"]
        options = {"first": entry["probability"], "nothing": entry["nothing"], "unknown": entry["unknown"]}
        best = max(options, key=lambda name: options[name])
        right = entry["first"] in truth if best == "first" else (best == "nothing" and not truth)
        said.append((options[best], right))
    return said


def calibration(entries: Sequence[Entry]) -> Rows:
    """Of the answers given with about so much probability, how many are right; and the two summaries."""
    said = answers(entries)
    if not said:
        return []
    rows: Rows = []
    expected = 0.0
    for low, high in BINS:
        inside = [(p, r) for p, r in said if low <= p < high]
        if inside:
            mean = float(np.mean([p for p, _ in inside]))
            rows.append(
                (f"calibration: told with {100 * mean:.1f} % on average", _share(r for _, r in inside))
            )
            expected += abs(sum(r - p for p, r in inside)) / len(said)
    brier = float(np.mean([(p - r) ** 2 for p, r in said]))
    rows.append(
        ("calibration: mean distance of told and true share; Brier score", f"{expected:.3f}; {brier:.3f}")
    )
    return rows


def by_effect(entries: Sequence[Entry]) -> list[list[str]]:
    """One line for each effect: first / in set, for each protocol, and what stood first instead."""
    groups: dict[tuple[str, str], list[Entry]] = defaultdict(list)
    for entry in entries:
        if len(entry["trial"]["effects"]) == 1 and not entry["trial"]["left_out"]:
            groups[entry["trial"]["effects"][0], kind(entry).split(":")[0]].append(entry)
    columns = sorted({where for _, where in groups})
    rows = [["effect", *[f"{c}: first, in set of" for c in columns], "first instead"]]
    for name in sorted({n for n, _ in groups}):
        cells, instead = [], Counter[str]()
        for where in columns:
            group = groups.get((name, where), [])
            hits = sum(is_first(g, [name]) for g in group)
            kept = sum(in_set(g, [name]) for g in group)
            cells.append(f"{hits}, {kept} of {len(group)}" if group else "-")
            instead.update(
                g.get("failed", "")[:40] or (g["first"] if g["verdict"] == "missing_effect" else g["verdict"])
                for g in group
                if not is_first(g, [name])
            )
        rows.append([name, *cells, ", ".join(f"{k} {v}" for k, v in instead.most_common(4))])
    return rows


def said_instead(entry: Entry) -> str:
    """What a diagnosis said, in one cell."""
    if "failed" in entry:
        return f"failed: {entry['failed'][:60]}"
    added = [name for name, _ in entry["path"] if name]
    if entry["verdict"] == "missing_effect":
        return " + ".join(added) or entry["first"]
    return entry["verdict"] + (f" (path: {' + '.join(added)})" if added else "")


def not_found(entries: Sequence[Entry]) -> list[list[str]]:
    """Pairs that were not both found, and effects left out of the catalogue that were not called strange."""
    rows = [["kind", "what was in the bench", "what was said"]]
    for entry in entries:
        name, truth = kind(entry), entry["trial"]["effects"]
        missed = name == "pairs" and not both_found(entry, truth)
        missed |= name == "outside" and not rightly_strange(entry, truth[0])
        if missed:
            rows.append([name, " + ".join(truth), said_instead(entry)])
    return rows


def summary(entries: Sequence[Entry]) -> str:
    """Figures, the lines of effects that were not always first, and what else went wrong."""
    lines = [f"{what:74s} {value}" for what, value in figures(entries)]
    lines += ["  ".join(row) for row in by_effect(entries)[1:] if row[-1]]
    lines += ["  ".join(row) for row in not_found(entries)[1:]]
    return "\n".join(lines)


BY_HAND = ("<!-- by hand -->", "<!-- end of what was written by hand -->")
"""What stands between these lines in the page is kept when it is made again."""


def markdown(entries: Sequence[Entry], command: str, before: str = "") -> str:
    """The committed page; ``before`` is its text so far."""
    lines = [
        "# Hidden effects: what the diagnosis finds without being told", "",
        f"Made by `{command}`. Every session is recorded on a bench with tolerances, noise and",
        "the effect at 0.6 to 1.6 times its default strength; the diagnosis sees the file alone.", "",
        *kept_by_hand(before), "", *markdown_table([["what", "figure"], *map(list, figures(entries))]), "",
        "## By effect", "", *markdown_table(by_effect(entries)),
    ]  # fmt: skip
    missed = not_found(entries)
    if len(missed) > 1:
        lines += [
            "",
            "## Pairs and effects outside the catalogue that were missed",
            "",
            *markdown_table(missed),
        ]
    return "\n".join(lines) + "\n"


def kept_by_hand(text: str) -> list[str]:
    """The lines between the marks, with them; the marks alone where there are none yet."""
    lines = text.splitlines()
    start, stop = BY_HAND
    if start not in lines or stop not in lines:
        return [start, stop]
    return lines[lines.index(start) : lines.index(stop) + 1]


def markdown_table(rows: Sequence[Sequence[str]]) -> list[str]:
    head, *rest = ["| " + " | ".join(row) + " |" for row in rows]
    return [head, "|" + "---|" * len(rows[0]), *rest]

"""From the trials' results to figures, a table by effect and a confusion table."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

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


def near(first: str, second: str) -> bool:
    """Whether two effects are physical neighbours."""
    return any({first, second} <= family for family in NEIGHBOURS)


def kind(entry: Entry) -> str:
    trial = entry["trial"]
    where = trial["protocol"] if trial["source"] == "twin" else "engine"
    if trial["left_out"]:
        return "outside"
    return {0: f"{where}: nothing", 1: f"{where}: one effect"}.get(len(trial["effects"]), "pairs")


def is_first(told: Entry, truth: Sequence[str]) -> bool:
    return told.get("verdict") == "missing_effect" and told["first"] in truth


def in_set(told: Entry, truth: Sequence[str]) -> bool:
    return told.get("verdict") == "missing_effect" and bool(set(truth) & set(told["set"]))


def both_found(told: Entry, truth: Sequence[str]) -> bool:
    return set(truth) <= {added for added, _ in told.get("path", [])}


def rightly_strange(told: Entry, missing: str) -> bool:
    if told.get("verdict") == "missing_effect":
        return any(near(missing, one) for one in told["set"])
    return bool(told.get("verdict") == "not_in_catalogue")


def _share(hits: Iterable[bool]) -> str:
    known = list(hits)
    return f"{sum(known)} of {len(known)} ({100 * np.mean(known):.0f} %)" if known else "-"


def figures(entries: Sequence[Entry]) -> list[tuple[str, str]]:
    """What was measured, and the figure."""
    by_kind: dict[str, list[Entry]] = defaultdict(list)
    for entry in entries:
        by_kind[kind(entry)].append(entry)
    rows: list[tuple[str, str]] = []
    for name, group in sorted(by_kind.items()):
        truths = [g["trial"]["effects"] for g in group]
        pairs = list(zip(group, truths, strict=True))
        if name.endswith("nothing"):
            rows.append(
                (f"{name}: false alarms", _share(g.get("verdict") != "nothing_missing" for g in group))
            )
        elif name == "outside":
            rows.append(
                (
                    "outside the catalogue: called so, or a neighbour",
                    _share(rightly_strange(g, t[0]) for g, t in pairs),
                )
            )
        elif name == "pairs":
            rows.append(("pairs: both found", _share(both_found(g, t) for g, t in pairs)))
            rows.append(("pairs: first step right", _share(is_first(g, t) for g, t in pairs)))
        else:
            rows.append((f"{name}: first", _share(is_first(g, t) for g, t in pairs)))
            rows.append((f"{name}: in the set", _share(in_set(g, t) for g, t in pairs)))
            sizes = [len(g["set"]) for g in group if g.get("set")]
            rows.append((f"{name}: median set", f"{np.median(sizes):g}" if sizes else "-"))
            after = [g["path"][1][1] for g, t in pairs if is_first(g, t) and len(g["path"]) > 1]
            if after:
                low = np.mean(np.array(after) <= 1.3)
                rows.append(
                    (
                        f"{name}: score with it, median / at most 1.3",
                        f"{np.median(after):.2f} / {100 * low:.0f} %",
                    )
                )
            followed = [(g.get("after", g), t) for g, t in pairs]
            if any("after" in g for g in group):
                rows.append(
                    (
                        f"{name}: first after the proposed experiment",
                        _share(is_first(g, t) for g, t in followed),
                    )
                )
    rows += calibration(entries)
    return rows


def calibration(entries: Sequence[Entry]) -> list[tuple[str, str]]:
    """Of the answers given with about so much probability, how many are right."""
    said: list[tuple[float, bool]] = []
    for entry in entries:
        if "verdict" not in entry or entry["trial"]["left_out"]:
            continue
        truth = entry["trial"]["effects"]
        options = {"first": entry["probability"], "nothing": entry["nothing"], "unknown": entry["unknown"]}
        best = max(options, key=lambda name: options[name])
        right = entry["first"] in truth if best == "first" else (best == "nothing" and not truth)
        said.append((options[best], right))
    rows = []
    for low, high in ((0.0, 0.6), (0.6, 0.85), (0.85, 0.97), (0.97, 1.001)):
        inside = [(p, r) for p, r in said if low <= p < high]
        if inside:
            mean = np.mean([p for p, _ in inside])
            rows.append(
                (f"calibration: told with {100 * mean:.0f} % on average", _share(r for _, r in inside))
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


def summary(entries: Sequence[Entry]) -> str:
    """Figures and the lines of effects that were not always first."""
    lines = [f"{what:62s} {value}" for what, value in figures(entries)]
    lines += ["  ".join(row) for row in by_effect(entries) if row[-1]]
    return "\n".join(lines)


def markdown(entries: Sequence[Entry], command: str) -> str:
    """The committed table."""
    lines = [
        "# Hidden effects: what the diagnosis finds without being told", "",
        f"Made by `{command}`. Every session is recorded on a bench with tolerances, noise and",
        "the effect at 0.6 to 1.6 times its default strength; the diagnosis sees the file alone.", "",
        "| what | figure |", "|---|---|",
    ]  # fmt: skip
    lines += [f"| {what} | {value} |" for what, value in figures(entries)]
    head, *rows = by_effect(entries)
    lines += ["", "## By effect", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"

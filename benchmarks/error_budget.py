"""Whether the budget's part of an effect is what the error falls by on a bench that lacks the effect.

    python benchmarks/error_budget.py --seeds 4001:4005

Every bench is simulated twice with one seed, with the effect and without; both are diagnosed. The part that
the budget gives the effect is compared with the fall from the first bench's squared error to the second's,
each as a share of the first. The table tells the median of the difference, over seeds, in percentage points.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.sessions import open_session
from fingerlab.twin.effects import EFFECTS, parse_effects
from fingerlab.twin.protocols import PROTOCOLS, load_preset
from fingerlab.twin.session import write_session

FAMILIES = ("joint_torque", "cable_kinematics", "endpoint_force")


def diagnosed(protocol: str, effects: list[str], seed: int) -> Diagnosis:
    """The diagnosis of a simulated session."""
    bench = load_preset("practice")
    plans = PROTOCOLS[protocol](bench.numbers["protocol"]["contact_amplitude_deg"])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.h5"
        write_session(path, bench, protocol, plans, parse_effects(effects), seed, False, lambda *_: None)
        return diagnose([open_session(path)], with_curves=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="4001:4005", help="first, and the one after the last")
    parser.add_argument("--protocol", default="rich")
    parser.add_argument("--effects", nargs="*", default=sorted(EFFECTS))
    options = parser.parse_args()
    seeds = range(*map(int, options.seeds.split(":")))
    plain = {seed: diagnosed(options.protocol, [], seed) for seed in seeds}
    every: list[list[float]] = []
    print("| effect | shown | " + " | ".join(f"{name}: part, fall (%)" for name in FAMILIES) + " |")
    print("|---|---:|" + "---:|" * len(FAMILIES))
    for name in options.effects:
        found = []
        for seed in seeds:
            result = diagnosed(options.protocol, [name], seed)
            if name not in result.final_model:
                continue
            both = []
            for family in FAMILIES:
                budget = result.budget[family]
                part = sum(one.mean_square for one in budget.parts if one.kind == "effect")
                fall = budget.mean_square - plain[seed].errors[family].rmse ** 2
                both.append((100 * part / budget.mean_square, 100 * fall / budget.mean_square))
            found.append(both)
            every.append([part - fall for part, fall in both])
        cells = [f"{p:.0f}, {f:.0f}" for p, f in np.median(found, axis=0)] if found else ["–"] * len(FAMILIES)
        print(f"| {name} | {len(found)} of {len(seeds)} | {' | '.join(cells)} |", flush=True)
    off = np.abs(every)
    for k, family in enumerate(FAMILIES):
        percentiles = ", ".join(f"{q} %: {np.percentile(off[:, k], q):.1f}" for q in (50, 80, 90, 100))
        print(f"{family}: |part - fall| in percentage points, {len(off)} benches: {percentiles}", flush=True)


if __name__ == "__main__":
    main()

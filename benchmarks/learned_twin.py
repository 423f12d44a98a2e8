"""Whether a twin of a verdict leads to the verdict: simulate, diagnose, simulate the model, diagnose again.

    python benchmarks/learned_twin.py --seed 4001

For every effect that a twin can be given: a bench with it is simulated and diagnosed, the model that the
diagnosis ends at is saved, a twin of its best values is simulated with another seed and diagnosed. The table
tells whether the same effects come out, and the largest distance of the effect's values from those of the
model, in half widths of both 90 % intervals together.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis import diagnose
from fingerlab.models.file import save_model
from fingerlab.prediction import fit_extended, model_of_extended
from fingerlab.sessions import open_session
from fingerlab.twin.bench import learned
from fingerlab.twin.effects import EFFECTS, Effects, parse_effects
from fingerlab.twin.protocols import PROTOCOLS, Preset, load_preset
from fingerlab.twin.session import write_session


def simulated(path: Path, bench: Preset, protocol: str, effects: Effects, seed: int) -> Path:
    """A session of a bench with these effects."""
    plans = PROTOCOLS[protocol](bench.numbers["protocol"]["contact_amplitude_deg"])
    write_session(path, bench, protocol, plans, effects, seed)
    return path


def one(name: str, protocol: str, seed: int, folder: Path) -> tuple[Sequence[str], Sequence[str], float]:
    """Effects of the model and of its twin's diagnosis, and how far the effect's values are apart."""
    bench = load_preset()
    first = [open_session(simulated(folder / "bench.h5", bench, protocol, parse_effects([name]), seed))]
    found = diagnose(first, with_curves=False)
    model = model_of_extended(fit_extended(first, found.final_model))
    save_model(model, folder / "model.json")
    twin = learned(folder / "model.json", bench, seed, best=True)
    again = [open_session(simulated(folder / "twin.h5", twin.preset, protocol, twin.effects, seed + 500))]
    other = diagnose(again, with_curves=False)
    apart = math.nan  # an effect without values of its own sets constants of the bench free
    for key, value in other.final_parameters.items():
        if key in model.parameters and key.partition(".")[0] in EFFECTS:
            given = model.parameters[key]
            half = math.hypot(0.5 * (given.high - given.low), 0.5 * (value.high - value.low))
            apart = np.fmax(apart, abs(given.value - value.value) / max(half, 1e-30))
    return found.final_model, other.final_model, float(apart)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=4001)
    parser.add_argument("--protocol", default="rich")
    parser.add_argument("--effects", nargs="*", default=sorted(EFFECTS))
    options = parser.parse_args()
    print("| effect | model | twin's diagnosis | apart |\n|---|---|---|---:|")
    for name in options.effects:
        with tempfile.TemporaryDirectory() as folder:
            try:
                before, after, apart = one(name, options.protocol, options.seed, Path(folder))
            except UserError as error:
                print(f"| {name} | refused: {str(error).partition(': ')[2]} | | |", flush=True)
                continue
        distance = "–" if math.isnan(apart) else f"{apart:.1f}"
        print(f"| {name} | {', '.join(before)} | {', '.join(after)} | {distance} |", flush=True)


if __name__ == "__main__":
    main()

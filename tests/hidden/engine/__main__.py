"""A table of blind trials: ``python -m tests.hidden.engine --protocol rich --seeds 1 2 --effects ...``."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from joblib import Parallel, delayed

from .effects import EFFECTS
from .trials import HEADER, Trial, blind_trial

PLAIN = "plain"


def _one(name: str, seed: int, protocol: str, duration_s: float | None) -> Trial:
    effects = {} if name == PLAIN else dict.fromkeys(name.split("+"))
    with tempfile.TemporaryDirectory() as folder:
        return blind_trial(effects, seed, protocol, Path(folder), duration_s)


def main() -> None:
    """Run the trials asked for and print a line for each, then how many were right."""
    parser = argparse.ArgumentParser(prog="python -m tests.hidden.engine", description=__doc__)
    parser.add_argument("--protocol", choices=("rich", "thesis"), default="rich")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument(
        "--effects",
        nargs="+",
        default=[PLAIN, *EFFECTS],
        help="catalogue ids, 'plain', or several joined with '+'",
    )
    parser.add_argument("--duration", type=float, default=None, help="seconds of each run")
    parser.add_argument("--jobs", type=int, default=1)
    asked = parser.parse_args()
    print(HEADER)
    jobs = (
        delayed(_one)(name, seed, asked.protocol, asked.duration)
        for name in asked.effects
        for seed in asked.seeds
    )
    trials = []
    for trial in Parallel(n_jobs=asked.jobs, return_as="generator")(jobs):
        trials.append(trial)
        print(trial.line(), flush=True)
    first, within = sum(t.first for t in trials), sum(t.in_set for t in trials)
    print(f"first {first} of {len(trials)}, in the set {within} of {len(trials)}")


if __name__ == "__main__":
    main()

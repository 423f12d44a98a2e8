"""How much faster than real time the twin runs, on one core: ``python benchmarks/twin_speed.py``.

Compilation is not counted. Processor time is printed beside wall time, because other work on the
machine slows the clock on the wall only.
"""

from __future__ import annotations

import time

from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import PROTOCOLS, load_preset
from fingerlab.twin.recording import simulate_session

CASES: dict[str, list[str]] = {
    "thesis protocol, no effect": [],
    "thesis protocol, friction everywhere": ["stribeck_friction", "motor_presliding", "capstan_friction"],
}


def main() -> None:
    """Simulate the thesis protocol (600 s of recording) and print the ratios."""
    preset = load_preset()
    plans = PROTOCOLS["thesis"](2.0)
    list(simulate_session(preset, [plans[0], plans[-1]], {}, 0))
    for title, effects in CASES.items():
        wall, processor, seconds = time.perf_counter(), time.process_time(), 0.0
        for run in simulate_session(preset, plans, parse_effects(effects), 1):
            seconds += len(run.channels["motor_command"]) / 1000.0
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        print(
            f"{title}: {seconds:.0f} s in {wall:.2f} s, {seconds / wall:.0f} times real time "
            f"({seconds / processor:.0f} by processor time)"
        )


if __name__ == "__main__":
    main()

"""What is told of a recording before it is diagnosed: whether its runs are long enough."""

from __future__ import annotations

import math
from pathlib import Path

from fingerlab.sessions import open_session


def short_runs_words(path: Path) -> str:
    """Which runs of a motor alone are too short for a diagnosis, and why; empty where none is.

    How long they have to be depends on the machine: what is logged or moves slowly is looked at slowly.
    """
    from fingerlab.diagnosis.settings import LEAST_RATE_HZ, SETTLING_SHARE, SHORTEST_STRETCH_S
    from fingerlab.diagnosis.signals.scales import LEAST_SECONDS, find_scales, reduced_run
    from fingerlab.diagnosis.signals.segments import is_too_short

    session = open_session(path)
    scales = find_scales([session])
    analysed = [(run, reduced_run(run, scales)) for run in session.runs if run.phase == "motor_bench"]
    short = [run for run, one in analysed if is_too_short(one)]
    if not short:
        return ""
    rate = min(run.sample_rate_hz for run, _ in analysed)
    by_rate = scales.time <= 2.0 ** math.ceil(math.log2(LEAST_RATE_HZ / rate) - 0.01)
    why = f"it is logged {rate:.3g} times a second" if by_rate else "it moves slowly"
    names = ", ".join(run.name for run in short[:5]) + (", ..." if len(short) > 5 else "")
    lasts = sorted(run.seconds for run in short)
    span = f"{lasts[0]:.1f}" if lasts[-1] - lasts[0] < 0.1 else f"{lasts[0]:.1f} to {lasts[-1]:.1f}"
    return (
        f"Run{'s' if len(short) > 1 else ''} {names} last{'' if len(short) > 1 else 's'} {span} s, too short "
        f"for a diagnosis: it leaves out {LEAST_SECONDS * SETTLING_SHARE * scales.time:.3g} s in which the "
        f"machine settles, and its filters need {SHORTEST_STRETCH_S * scales.time:.3g} s of what follows, so "
        f"that of this machine it needs {LEAST_SECONDS * scales.time:.3g} s a run, for {why}. "
        f"Record longer runs{', or log faster' if by_rate else ''}."
    )

"""What the real-time benchmark measures, and its page."""

from __future__ import annotations

from dataclasses import dataclass, field

from benchmarks.machine import machine_words


@dataclass(frozen=True)
class Timed:
    """One measurement. Lateness in ms at the percentiles 50, 99, 99.9 and the largest; load averages.

    ``busy``, ``stolen``: per cent of the machine that programs used, and that its host kept for others.
    ``bare_ms``: lateness of a bare loop of waits. ``driven``: whether the motor was to run, ``driven_share``
    for how much of the cycles it did, ``stops``: a sentence for each time that the checks stopped it.
    ``granted``: how the system schedules the loop. ``free_plots``: so many of the window's, beside the six.
    ``beside``: whether another process took a core. ``code``: with which program. ``stood_ms``: how long the
    machine itself stood still, on one core or more, each time (None: not watched), and ``stops_stood`` how
    many of the stops came with that.
    """

    window: bool
    minutes: float
    cycles: int
    lateness_ms: list[float]
    late: int
    lost: int
    unread: int
    recorded: int
    load_before: float
    load_after: float
    busy: float
    stolen: float
    window_share: float
    bare_ms: list[float]
    driven: bool = False
    driven_share: float = 0.0
    stops: list[str] = field(default_factory=list)
    granted: str = "before others"
    free_plots: int = 0
    beside: bool = False
    code: str = ""
    stood_ms: list[float] | None = None
    stops_stood: int = 0


def page(results: list[Timed], speeds: dict[int, float], rate_hz: float) -> str:
    """The measurements as a page of documentation."""
    table = {
        "program": [r.code for r in results],
        "window drawing": [
            f"yes, {6 + r.free_plots} plots, {r.free_plots} of them free" if r.window else "no"
            for r in results
        ],
        "another process takes a core": ["yes" if r.beside else "no" for r in results],
        "motor driven": [
            f"yes, {100 * r.driven_share:.1f} % of the time" if r.driven else "no" for r in results
        ],
        "stopped by the safety checks": [str(len(r.stops)) if r.driven else "-" for r in results],
        "the machine stood still for more than 12 ms: times, longest": [
            "-" if r.stood_ms is None else f"{len(r.stood_ms)}, {max(r.stood_ms, default=0.0):.0f} ms"
            for r in results
        ],
        "of the stops, with such a moment": [
            "-" if r.stood_ms is None or not r.driven else str(r.stops_stood) for r in results
        ],
        "the loop is scheduled": [r.granted for r in results],
        "minutes": [f"{r.minutes:g}" for r in results],
        "cycles": [f"{r.cycles:,}" for r in results],
        "lateness p50, ms": [f"{r.lateness_ms[0]:.3f}" for r in results],
        "lateness p99, ms": [f"{r.lateness_ms[1]:.3f}" for r in results],
        "lateness p99.9, ms": [f"{r.lateness_ms[2]:.3f}" for r in results],
        "latest cycle, ms": [f"{r.lateness_ms[3]:.1f}" for r in results],
        "bare loop of waits: p50, p99, p99.9, latest, ms": [
            ", ".join(f"{one:.3g}" for one in r.bare_ms) for r in results
        ],
        "cycles more than 0.5 ms late": [f"{r.late:,}" for r in results],
        "cycles lost": [f"{r.lost:,} ({100 * r.lost / (r.cycles + r.lost):.3f} %)" for r in results],
        "samples that the recorder or the witness missed": [str(r.unread) for r in results],
        "samples in the file": [f"{r.recorded:,}" for r in results],
        "processor time of the window's process, % of a core": [f"{r.window_share:.0f}" for r in results],
        "load average before, after": [f"{r.load_before:.1f}, {r.load_after:.1f}" for r in results],
        "machine busy meanwhile, % of all cores": [f"{r.busy:.0f}" for r in results],
        "kept by the host for other machines, %": [f"{r.stolen:.0f}" for r in results],
    }
    rows = [f"| {words} | {' | '.join(cells)} |" for words, cells in table.items()]
    rows.insert(1, "|---|" + "---|" * len(results))
    speed = "\n".join(f"| {piece} | {rate:,.0f} | {rate / rate_hz:.0f} |" for piece, rate in speeds.items())
    stops = "".join(f"- {sentence}\n" for r in results for sentence in r.stops)
    stops_text = (
        f"\nWhat stopped the motor, each time begun anew by hand as after any fault:\n\n{stops}"
        if stops
        else ""
    )
    return TEXT.format(rows="\n".join(rows), stops=stops_text, speed=speed, machine=machine_words())


TEXT = """# Real time

Made with `python -m benchmarks.real_time`, without and with `--with-window`, `--free-plots`, `--driven` and
`--beside`, on {machine}.
Other programs shared the machine, as its load tells: a machine of one's own is more punctual.

The simulated rig at 1 kHz by the machine's clock, every sample recorded. Where the motor is not driven the
loop is spared the checks and the position loop (some 10 of 1000 us a cycle). Where it is, it follows a sine
on air with every safety check on, and is stopped at the first 20 ms that the machine holds the loop up.
Lateness is how long after its due time a cycle began, the machine's own oversleeping included; who comes a
whole period late has lost the cycles in between, and they are stored as a gap. The loop asks the system to be
scheduled in real time (Linux, where the user may), else before others.

{rows}
{stops}
Samples a second that the recorder takes from the ring to the disk, sixteen channels and time, flushed ten
times a second of rig time:

| samples at a time | samples a second | times 1 kHz |
|---|---|---|
{speed}
"""

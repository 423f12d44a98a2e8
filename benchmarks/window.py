"""What the window costs: starting, changing tabs, what one waits for, reviewing ten hours, live plots.

    python -m benchmarks.window [--keep FILE] [start] [work] [review] [live]

Off screen at 1280 x 800. Writes docs/benchmarks-window.md: all of it, or, with ``--keep``, the parts that are
measured now and those kept from before. Beside every figure stands how much of the machine others had
meanwhile, and by how much a fixed loop was slowed.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benches import SIZE, shown_window
from benchmarks.machine import Share, code_words, machine_words
from benchmarks.window_repaint import FRAMES, WINDOW_S, Repainted, repaint
from benchmarks.window_review import HOURS, OVER_HOURS, OVERS, Reviewed, review
from benchmarks.window_start import Started, start_times, switch_times
from benchmarks.window_work import Worked, work

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "benchmarks-window.md"
START_GOAL_S = 2.0
REPAINT_GOAL_MS = 33.0
CPU_GOAL = 40.0

FRAME_HEAD = (
    "| frames, ms | p50 | p99 | longest | processor, p50 | processor, p99 |",
    "|---|---|---|---|---|---|",
)

Parts = dict[str, Any]
"""Part -> what was measured, as plain JSON."""


def measure_start(folder: Path) -> Started:
    """Starts in processes of their own, then changes of tab."""
    started = start_times(folder)
    with shown_window(folder, "model_lab") as (window, app):
        started.switches = switch_times(window, app)
    return started


def measure_work(folder: Path) -> Worked:
    """What one waits for."""
    with shown_window(folder, "model_lab") as (window, app):
        return work(window, app, folder)


def measure_review(folder: Path) -> Reviewed:
    """Ten hours in Sessions."""
    with shown_window(folder, "sessions") as (window, app):
        return review(window, app, folder)


def measure_live(folder: Path) -> Repainted:
    """The plots of Acquire."""
    with shown_window(folder, "acquire") as (window, app):
        return repaint(window, app)


MEASURES: dict[str, Callable[[Path], Any]] = {
    "start": measure_start,
    "work": measure_work,
    "review": measure_review,
    "live": measure_live,
}


def page(parts: Parts) -> str:
    """The measurements as Markdown."""
    lines = [
        "# Benchmarks of the window",
        "",
        f"Made with `python -m benchmarks.window` on {machine_words()}, {code_words()}; window of {SIZE[0]} "
        f"x {SIZE[1]}, off screen. Times are on the wall; the processor's are this process' own, which "
        "others on the machine stretch less. The machine was shared: beneath each table stands what others "
        "had of it meanwhile.",
        "",
    ]
    kinds = (("start", start_lines), ("work", work_lines), ("review", review_lines), ("live", live_lines))
    for name, lines_of in kinds:
        if name in parts:
            lines += lines_of(parts[name])
    return "\n".join(lines).rstrip() + "\n"


def start_lines(started: dict[str, Any]) -> list[str]:
    """From the command to the window, and from tab to tab."""
    lines = [
        "## Starting",
        "",
        "From the command until the first picture is painted and a click would be answered, every time in a "
        "process of its own. Cold: with nothing compiled yet.",
        "",
        "| tab shown | p50 | longest | goal |",
        "|---|---|---|---|",
        f"| cold, Model lab | {started['cold']:.2f} s | | |",
    ]
    for tab, times in started["warm"].items():
        row = f"| warm, {_tab(tab)} | {np.median(times):.2f} s | {max(times):.2f} s "
        lines.append(f"{row}| under {START_GOAL_S:g} s |")
    lines += [
        *_beneath(started["share"]),
        "## Changing tabs",
        "",
        "Until the other tab is painted. The first time it is built.",
        "",
        "| tab | first | p50 | p99 |",
        "|---|---|---|---|",
    ]
    for tab, times in started["switches"].items():
        later = times[1:]
        lines.append(f"| {_tab(tab)} | {times[0]:.0f} ms | {_p(later, 50):.1f} ms | {_p(later, 99):.1f} ms |")
    return [*lines, ""]


def work_lines(worked: dict[str, Any]) -> list[str]:
    """What one waits for."""
    rows = [f"| {words} | {wall:.2f} | {spent:.2f} |" for words, (wall, spent) in worked["steps"].items()]
    return [
        "## What one waits for",
        "",
        "A session of the rich protocol, 14 runs of 20 s, with Coulomb friction; folders with copies of one "
        "run. From the click until it is painted. Read files are known again by their time and size.",
        "",
        "| what | s | processor, s |",
        "|---|---|---|",
        *rows,
        *_beneath(worked["share"]),
    ]


def review_lines(reviewed: dict[str, Any]) -> list[str]:
    """Opening, panning and zooming."""
    lines = [
        f"## Reviewing {HOURS:g} hours in Sessions",
        "",
        f"A session of {HOURS:g} hours in one run and {OVER_HOURS:g} in each of {OVERS} others, which can be "
        f"laid over it; seven channels at 1 kHz. It is shown after {reviewed['shown']:.2f} s and grows while "
        f"it is read, until {reviewed['read']:.0f} s.",
        "",
        *FRAME_HEAD,
    ]
    for words, times in reviewed["frames"].items():
        lines.append(frame_row(words, times))
    return [*lines, *_beneath(reviewed["share"])]


def frame_row(words: str, times: Sequence[Sequence[float]]) -> str:
    """Percentiles on the wall, and of the processor's time alone."""
    wall, processor = np.asarray(times, dtype=float).T
    cells = (_p(wall, 50), _p(wall, 99), wall.max(), _p(processor, 50), _p(processor, 99))
    return f"| {words} | {' | '.join(f'{cell:.1f}' for cell in cells)} |"


def live_lines(found: dict[str, Any]) -> list[str]:
    """Repaints by themselves, and the processor's part in real time."""
    return [
        "## Live plots",
        "",
        f"Six plots of {WINDOW_S:g} s at 1 kHz, {FRAMES} repaints on a virtual clock; then the simulated rig "
        "in real time.",
        "",
        *FRAME_HEAD,
        frame_row(f"repaint; p99 is to be under {REPAINT_GOAL_MS:g} ms", found["times"]),
        *_beneath(found["share"]),
        "| what | measured | goal |",
        "|---|---|---|",
        f"| window's process at {found['rate']:.1f} repaints a second "
        f"| {found['processor']:.0f} % of a core | under {CPU_GOAL:g} % |",
        *_beneath(found["real_share"]),
    ]


def _beneath(share: dict[str, float] | None) -> tuple[str, ...]:
    return ("", f"The machine: {Share(**share).words()}." if share is not None else "", "")


def _tab(key: str) -> str:
    words = key.replace("_", " ")
    return words[:1].upper() + words[1:]


def _p(times: Sequence[float], percent: float) -> float:
    return float(np.percentile(np.asarray(times), percent))


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(MEASURES)}; all of them by default")
    parser.add_argument("--keep", type=Path, help="JSON of parts: those not measured now are taken from it")
    options = parser.parse_args()
    unknown = set(options.parts) - set(MEASURES)
    if unknown:
        parser.error(f"there is no part {', '.join(sorted(unknown))}; known are {', '.join(MEASURES)}")
    parts: Parts = {}
    if options.keep is not None and options.keep.exists():
        parts = json.loads(options.keep.read_text(encoding="utf-8"))
    for name in options.parts or MEASURES:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            parts[name] = asdict(MEASURES[name](Path(folder)))
        if options.keep is not None:
            options.keep.write_text(json.dumps(parts), encoding="utf-8")
    text = page(parts)
    print(text)
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

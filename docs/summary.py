"""What the pages of measurements say, in one table: read from these pages whenever the documents are built.

No number is copied by hand. A page that is missing, or whose table has another form by now, leaves its rows
out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

MARK = "<!-- docs/generate.py puts the summary here -->"
"""What ``validation.md`` holds in place of the table."""
Rows = list[list[str]]


def summary(folder: Path) -> str:
    """The table, Markdown.

    Args:
        folder: holds the pages.
    """
    rows = [
        row
        for part in (
            _as_built,
            _hidden,
            _wrong,
            _feed_forward,
            _drafted,
            _changed,
            _probabilities,
            _proposed_runs,
            _replicate,
            _faults,
            _sessions,
            _real_time,
            _window,
            _soak,
        )
        for row in part(folder)
    ]
    return "\n".join(["| what | figure | read from |", "|---|---|---|", *rows])


def tables(text: str) -> Iterator[tuple[list[str], Rows]]:
    """Head and body of every Markdown table of a page."""
    for block in re.findall(r"(?:^\|.*\|\n?)+", text, flags=re.MULTILINE):
        lines = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in block.splitlines()]
        if len(lines) > 2 and set("".join(lines[1])) <= set("-: "):
            yield lines[0], lines[2:]


def table(path: Path, *titles: str) -> tuple[list[str], Rows]:
    """The first table whose head holds these titles; empty where there is none."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return next((t for t in tables(text) if all(title in t[0] for title in titles)), ([], []))


def _line(what: str, figure: str, page: str, title: str) -> str:
    return f"| {what} | {figure} | [{title}]({page}) |"


def _hidden(folder: Path) -> Iterator[str]:
    _, rows = table(folder / "hidden-effects.md", "what", "figure")
    for what, figure, *_ in rows:
        yield _line(f"blind trials, {what}", figure, "hidden-effects.md", "Hidden effects")


def _as_built(folder: Path) -> Iterator[str]:
    _, rows = table(folder / "as-built.md", "what", "sessions")
    for what, figure, *_ in rows:
        yield _line(f"the bench as built, {what}", figure, "as-built.md", "As built")


def _wrong(folder: Path) -> Iterator[str]:
    _, rows = table(folder / "wrong-additions.md", "what", "figure")
    for what, figure, *_ in rows:
        yield _line(what, figure, "wrong-additions.md", "Wrong additions")


def _feed_forward(folder: Path) -> Iterator[str]:
    head, rows = table(folder / "feed-forward.md", "what")
    for bench, *figures in zip(head[1:], *(row[1:] for row in rows), strict=True):
        for (what, *_), figure in zip(rows, figures, strict=True):
            if what.startswith("found / nominal") or what.startswith("worse"):
                yield _line(f"a wanted force, {what}: {bench}", figure, "feed-forward.md", "Feed-forward")


def _drafted(folder: Path) -> Iterator[str]:
    _, rows = table(folder / "draft-laws.md", "what", "figure")
    for what, figure in rows:
        yield _line(f"effects left out of the catalogue: {what}", figure, "draft-laws.md", "Drafted laws")


def _changed(folder: Path) -> Iterator[str]:
    _, rows = table(folder / "changes-over-time.md", "what", "figure")
    for what, figure in rows:
        yield _line(f"benches over sessions: {what}", figure, "changes-over-time.md", "Changes over time")


def _probabilities(folder: Path) -> Iterator[str]:
    head, rows = table(folder / "probabilities.md", "without calibration", "calibrated")
    for row in rows:
        if row[0] in ("expected calibration error", "truth in the set", "answers in the set, median; mean"):
            figure = f"{row[head.index('calibrated')]} (without calibration {row[1]})"
            yield _line(f"probabilities: {row[0]}", figure, "probabilities.md", "Probabilities")
    _, rows = table(folder / "probabilities.md", "all", "twin")
    for row in rows:
        if row[0] in ("expected calibration error", "truth in the set"):
            what = f"probabilities on seeds that nothing was fitted to: {row[0]}"
            yield _line(what, row[1], "probabilities.md", "Probabilities")


def _proposed_runs(folder: Path) -> Iterator[str]:
    _, rows = table(folder / "foretold.md", "what", "figure")
    for what, figure, *_ in rows:
        if "factor of two" in what or "alone in the set after" in what or "first after" in what:
            yield _line(f"proposed runs: {what}", figure, "foretold.md", "Proposed runs")


def _replicate(folder: Path) -> Iterator[str]:
    _, rows = table(folder / "replicate.md", "quantity", "published")
    for row in rows:
        found = re.match(r"within the spread, of (\d+)", row[0])
        if found and len(row) > 2:
            seeds = ", ".join(row[3:])
            yield _line(
                "the thesis' experiment: numbers within the published spread",
                f"{row[2]} of {found[1]}" + (f"; by bench {seeds}" if seeds else ""),
                "replicate.md",
                "The thesis' experiment",
            )


def _faults(folder: Path) -> Iterator[str]:
    head, rows = table(folder / "faults.md", "killed", "kills", "zero and low")
    at = {title: place for place, title in enumerate(head)}
    for row in rows:
        figure = f"{row[at['zero and low']]} of {row[at['kills']]} ended at zero volts and low enable"
        if "plant ms, most" in at and "s lost, most" in at:
            figure += (
                f", after {row[at['plant ms, most']]} ms at most; {row[at['s lost, most']]} s lost at most"
            )
        yield _line(f"faults: {row[0]} killed while the motor is driven", figure, "faults.md", "Faults")
    _, others = table(folder / "faults.md", "fault", "zero after")
    if others:
        going_on = sum(row[1] == "goes on" for row in others)
        yield _line(
            "faults: others, each in full motion",
            f"{len(others)} tried: {len(others) - going_on} stop the motor, {going_on} may go on",
            "faults.md",
            "Faults",
        )


def _sessions(folder: Path) -> Iterator[str]:
    head, rows = table(folder / "benchmarks.md", "step", "size", "wall, s")
    for row in rows:
        cells = dict(zip(head, row, strict=False))
        if cells["step"] == "diagnose" and cells["size"].isdigit():
            memory = cells.get("peak memory, MB", "–")
            yield _line(
                f"diagnosis of {cells['size']} times the thesis' session",
                f"{cells['wall, s']} s, {memory} MB",
                "benchmarks.md",
                "Benchmarks",
            )
    text = (folder / "benchmarks.md").read_text(encoding="utf-8") if rows else ""
    for name, speed in re.findall(r"^- (.+?): .*?, (\d+) times real time", text, flags=re.MULTILINE):
        yield _line(f"simulated bench, {name}", f"{speed} times real time", "benchmarks.md", "Benchmarks")


REAL_TIME_ROWS = ("lateness p50, ms", "lateness p99, ms", "cycles lost")


def _real_time(folder: Path) -> Iterator[str]:
    name = "benchmarks-real-time.md"
    head, rows = table(folder / name, "window drawing")
    driven = next((row[1:] for row in rows if row[0] == "motor driven"), ["no"] * len(head))
    cases = [
        f"window drawing: {drawing}" + (", motor driven" if motor.startswith("yes") else "")
        for drawing, motor in zip(head[1:], driven, strict=False)
    ]
    for row in rows:
        if row[0] in REAL_TIME_ROWS:
            figure = "; ".join(f"{value} ({case})" for case, value in zip(cases, row[1:], strict=False))
            yield _line(f"control loop at 1 kHz on a shared machine, {row[0]}", figure, name, "Real time")
    _, speeds = table(folder / name, "samples at a time", "samples a second")
    for pieces, rate, times in speeds:
        what = f"recorder, ring to disk, {pieces} samples at a time"
        yield _line(what, f"{rate} samples a second, {times} times 1 kHz", name, "Real time")


def _window(folder: Path) -> Iterator[str]:
    path, title = folder / "benchmarks-window.md", "The window, measured"
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    for head, rows in tables(text):
        for row in rows:
            cells = dict(zip(head, row, strict=False))
            if "tab shown" in cells and row[0].startswith("warm, "):
                figure = f"{cells['p50']} (p50), {cells['longest']} at most"
                yield _line(f"the window starts on {row[0].removeprefix('warm, ')}", figure, path.name, title)
            elif row[0].startswith("repaint"):
                figure = f"{cells['p50']} ms (p50), {cells['p99']} ms (p99)"
                yield _line("six live plots of 60 s repainted", figure, path.name, title)
            elif "goal" in cells and "measured" in cells:
                yield _line(row[0], cells["measured"], path.name, title)


SOAK_ROWS = ("samples in the file", "cycles lost, rows unread", "largest difference from the first minute")


def _soak(folder: Path) -> Iterator[str]:
    head, rows = table(folder / "soak.md", "hours of rig time")
    for row in rows:
        if row[0] in SOAK_ROWS:
            what = row[0].replace("largest difference", "memory, largest difference")
            yield _line(
                f"{' and '.join(head[1:])} h in one run, {what}", "; ".join(row[1:]), "soak.md", "Soak"
            )

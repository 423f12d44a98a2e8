"""STOP with everything open that can stand open, counted in ``docs/faults.md``.

``python -m tests.faults.stops`` starts an X server without a screen (Xvfb) with a window manager (openbox),
and in it the window with the simulated rig in real time. Whatever the program can open is opened
(``tests/ui/everything_open.py``), stopped by a press, by Escape and by the foot switch's key, all as events
of the X server. ``--keep FILE`` writes the page from outcomes taken before; ``--new`` takes only what the
page has no row for yet, and leaves its other rows.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "faults.md"
BEGIN, END = "<!-- made by tests.faults.stops -->", "<!-- end of what tests.faults.stops made -->"
DISPLAY = ":97"
LIMIT_MS = 50.0
WAYS = ("press", "Escape", "key")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="JSON lines of outcomes: written, or read where it exists")
    parser.add_argument("--new", action="store_true", help="only what the page has no row for")
    options = parser.parse_args()
    page = PAGE.read_text(encoding="utf-8")
    before = outcomes_of(page) if options.new else []
    with tempfile.TemporaryDirectory() as folder:
        path = options.keep or Path(folder) / "stops.jsonl"
        if not path.exists():
            take(path, [outcome["surface"] for outcome in before])
        outcomes = before + [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    PAGE.write_text(with_section(page, section(outcomes)), encoding="utf-8")


def outcomes_of(page: str) -> list[dict[str, Any]]:
    """What the rows of the page's table say."""
    rows = page[page.index(BEGIN) : page.index(END)].splitlines()
    outcomes = []
    table = [row.strip("|").split("|") for row in rows if row.startswith("|")]
    for name, *cells in ([cell.strip() for cell in row] for row in table):
        if name == "standing open" or set(name) == {"-"}:
            continue
        for way, cell_ in zip(WAYS, cells, strict=True):
            ms, _, wrong = cell_.partition(" ")
            if ms != "–":
                took = None if ms == "never" else float(ms)
                outcomes.append({"surface": name, "way": way, "plant_ms": took, "wrong": wrong.strip("()")})
    return outcomes


def take(path: Path, known: list[str]) -> None:
    """Take the outcomes under an X server of its own, but for what is known."""
    environment = {**os.environ, "DISPLAY": DISPLAY, "QT_QPA_PLATFORM": "xcb", "FINGERLAB_STOPS": str(path)}
    environment["FINGERLAB_STOPS_KNOWN"] = json.dumps(known)
    server = subprocess.Popen(["Xvfb", DISPLAY, "-screen", "0", "1920x1080x24"])
    time.sleep(2.0)
    manager = subprocess.Popen(["openbox"], env=environment)
    test = "tests/ui/app/test_stop_everywhere.py"
    try:
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            test,
            "-k",
            "anything_open",
            "-p",
            "no:cacheprovider",
        ]
        subprocess.run(command, env=environment, cwd=ROOT, check=False)
    finally:
        for process in (manager, server):
            process.terminate()
            process.wait()


def section(outcomes: list[dict[str, Any]]) -> str:
    """The outcomes as a part of the page."""
    names = list(dict.fromkeys(outcome["surface"] for outcome in outcomes))
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for o in sorted(outcomes, key=_taken_ms):  # of two lists of one name the later stop is told
        found[o["surface"], o["way"]] = o
    rows = []
    for name in names:
        cells = [cell(found.get((name, way))) for way in WAYS]
        rows.append(f"| {name} | {' | '.join(cells)} |")
    times = [o["plant_ms"] for o in outcomes if o["plant_ms"] is not None]
    return TEXT.format(
        rows="\n".join(rows),
        count=len(outcomes),
        most=f"{max(times):.0f}",
        median=f"{sorted(times)[len(times) // 2]:.0f}",
        over=sum(ms > LIMIT_MS for ms in times),
        never=sum(o["plant_ms"] is None for o in outcomes),
        wrong=sum(bool(o["wrong"]) for o in outcomes),
    )


def _taken_ms(outcome: dict[str, Any]) -> float:
    return math.inf if outcome["plant_ms"] is None else float(outcome["plant_ms"])


def cell(outcome: dict[str, Any] | None) -> str:
    """ms, or what went wrong."""
    if outcome is None:
        return "–"
    ms = "never" if outcome["plant_ms"] is None else f"{outcome['plant_ms']:.0f}"
    return f"{ms} ({outcome['wrong']})" if outcome["wrong"] else ms


def with_section(page: str, text: str) -> str:
    """The page with this section in place of the one that it has."""
    begin, end = page.index(BEGIN), page.index(END) + len(END)
    return page[:begin] + text.rstrip("\n") + page[end:]


TEXT = (
    BEGIN
    + """

`python -m tests.faults.stops` takes this table: the simulated rig in real time under position control, the
window under an X server with a window manager, and events of that server (XTEST). Whatever the program can
open is opened, and 0.3 s later STOP is pressed and held, or Escape or the foot switch's key (Pause) is sent.
The figure is plant time in ms: samples of the ring from before the event to the first with zero set value
and enable low. What the loop has stopped by itself before the event, as other programs held the window up for
half a second, is taken again.
{count} stops: median {median} ms, most {most} ms, over 50 ms {over}, not stopped {never};
an entry picked, a dialog shut by the press or the key, or something that did not open: {wrong}.

| standing open | press | Escape | key |
|---|---|---|---|
{rows}

"""
    + END
)


if __name__ == "__main__":
    main()

"""``python -m tests.goldens store FOLDER`` and ``compare FOLDER``: what was said, before a change and after.

Goldens lie outside of the repository: some are made of recordings that are not ours to pass on.
"""

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import click

from tests.goldens.comparing import Difference, differences
from tests.goldens.items import Item, recordings, sweep
from tests.goldens.running import ROOT, Taken, commit, machine, read, take_all, write

RECORDINGS = ROOT.parent / "shared" / "data"
SHOWN = 5
"""So many differing values of a session are shown."""


def _options(command: Any) -> Any:
    for option in (
        click.argument("folder", type=click.Path(path_type=Path, file_okay=False)),
        click.option("--recordings", "data", default=RECORDINGS, show_default=True,
                     type=click.Path(path_type=Path), help="Recordings that the project did not make."),
        click.option("--part", default="quick", show_default=True, type=click.Choice(["quick", "all"])),
        click.option("--only", multiple=True, metavar="NAME", help="Only these sessions; repeatable."),
        click.option("--step", "wanted", multiple=True, metavar="STEP",
                     help="Only these steps, such as 'diagnose' or 'sums'; repeatable."),
        click.option("--backwards", is_flag=True, help="The last session first."),
        click.option("--jobs", default=1, show_default=True, help="Processes."),
    ):  # fmt: skip
        command = option(command)
    return command


@click.group()
def main() -> None:
    """Store what the program says of many sessions, and compare it with what it says later."""


@main.command()
@_options
def store(
    folder: Path,
    data: Path,
    part: str,
    only: tuple[str, ...],
    wanted: tuple[str, ...],
    backwards: bool,
    jobs: int,
) -> None:
    """Store goldens in FOLDER; what is there already is kept, so that one that was stopped can go on."""
    folder.mkdir(parents=True, exist_ok=True)
    _say_where(folder)
    work = []
    for item, steps in _work(data, part, only, wanted, backwards):
        known = read(folder / f"{item.name}.json")
        left = [step for step in steps if known is None or step not in known["steps"]]
        if left:
            work.append((item, left))
    if not (folder / "machine.json").exists():
        told = {"commit": commit(), **machine()}
        (folder / "machine.json").write_text(json.dumps(told, indent=1), encoding="utf-8")
    failed, started = 0, time.monotonic()
    for number, taken in enumerate(take_all(work, folder / "sessions", jobs, False), start=1):
        failed += bool(taken.failed)
        if not taken.failed:
            write(folder, taken)
        passed = time.monotonic() - started
        click.echo(f"{number}/{len(work)} {passed:6.0f} s  {taken.name}  {taken.failed or 'stored'}")
    click.echo(f"{len(work) - failed} stored, {failed} failed, the others were there already.")
    sys.exit(1 if failed else 0)


@main.command()
@_options
@click.option(
    "--made-anew/--keep-sessions",
    default=False,
    show_default=True,
    help="Make every simulated session once more, too, and say where the simulator makes another.",
)
@click.option("--tolerance", default=0.0, show_default=True, help="Relative; 0 is to the last bit.")
@click.option("--but-for", multiple=True, metavar="PATTERN",
              help="Pass over values at such places: 'report.*', '*.printed*'; repeatable.")  # fmt: skip
def compare(
    folder: Path, data: Path, part: str, only: tuple[str, ...], wanted: tuple[str, ...], backwards: bool,
    jobs: int, made_anew: bool, tolerance: float, but_for: tuple[str, ...],
) -> None:  # fmt: skip
    """Compare the goldens in FOLDER with what the program says now, of the very session files kept there."""
    _say_where(folder)
    work, missing = [], []
    for item, steps in _work(data, part, only, wanted, backwards):
        known = read(folder / f"{item.name}.json")
        stored = [step for step in steps if known is not None and step in known["steps"]]
        if len(stored) < len(steps):
            missing.append(item.name)
        if stored:
            work.append((item, stored))
    differing, largest, started = 0, (0.0, ""), time.monotonic()
    for number, taken in enumerate(take_all(work, folder / "sessions", jobs, made_anew), start=1):
        found = _compared(folder, taken, tolerance, but_for)
        differing += bool(found)
        passed = time.monotonic() - started
        word = (
            "equal"
            if not found
            else "could not be taken"
            if taken.failed
            else f"{len(found)} {'value differs' if len(found) == 1 else 'values differ'}"
        )
        click.echo(f"{number}/{len(work)} {passed:6.0f} s  {taken.name}: {word}")
        for one in found[:SHOWN]:
            click.echo(f"    {one.line()}")
        worst = max(found, key=lambda d: d.relative or 0.0, default=None)
        if worst is not None and (worst.relative or 0.0) > largest[0]:
            largest = worst.relative or 0.0, f"{taken.name}: {worst.place}"
    _sum_up(len(work), differing, missing, largest)


def _sum_up(count: int, differing: int, missing: list[str], largest: tuple[float, str]) -> None:
    if missing:
        click.echo(
            f"Not stored, or not all of it: {', '.join(missing[:SHOWN])}{' ...' * (len(missing) > SHOWN)}"
        )
    size = f"; the largest relative difference is {largest[0]:.3g} ({largest[1]})" if largest[0] else ""
    click.echo(
        f"{count} compared: {count - differing} equal, {differing} differ, {len(missing)} not stored{size}."
    )
    sys.exit(1 if differing or missing or not count else 0)


def _compared(folder: Path, taken: Taken, tolerance: float, but_for: tuple[str, ...]) -> list[Difference]:
    if taken.failed:
        return [Difference("session", "stored", taken.failed, math.inf)]
    golden = read(folder / f"{taken.name}.json") or {}
    stored = {"session file": golden["content"], **{step: golden["steps"][step] for step in taken.steps}}
    # Through JSON like the stored ones: the same kinds of lists, keys and numbers.
    now = {"session file": taken.content, **json.loads(json.dumps(taken.steps))}
    if taken.anew is not None:
        stored["session made anew"], now["session made anew"] = golden["content"], taken.anew
    return differences(stored, now, tolerance, but_for)


def _work(
    data: Path, part: str, only: tuple[str, ...], wanted: tuple[str, ...], backwards: bool
) -> list[tuple[Item, list[str]]]:
    if not data.is_dir():
        click.echo(f"there are no recordings at {data}; only made sessions are asked", err=True)
    every = [*recordings(data), *sweep()]
    if unknown := set(only) - {item.name for item in every}:
        raise click.UsageError(f"there is no session {', '.join(sorted(unknown))}")
    chosen = [item for item in every if not only or item.name in only]
    work = [(item, [s for s in item.of(part) if not wanted or s in wanted]) for item in chosen]
    work = [(item, steps) for item, steps in work if steps]
    return work[::-1] if backwards else work


def _say_where(folder: Path) -> None:
    """The program's code that is asked, and whether this machine is the one that the goldens are from."""
    import fingerlab  # imports nothing else

    click.echo(f"fingerlab from {Path(fingerlab.__file__).parent}", err=True)
    path = folder / "machine.json"
    if not path.exists():
        return
    stored, here = json.loads(path.read_text(encoding="utf-8")), machine()
    for name, value in here.items():
        if stored.get(name) != value:
            click.echo(f"stored with {name} {stored.get(name)}, here {value}: last bits may differ", err=True)


if __name__ == "__main__":
    main()

"""Files that strangers could make, through every command that reads them: ``docs/faults.md`` has the table.

``python -m tests.faults.crafted [--only TEXT] [--flips N] [--keep FILE]`` makes each kind in a folder of its
own and gives it to each command in a process of its own. Wanted: exit 0 or 2, then with one sentence;
nothing written but what was asked for; nothing of another file told; below 1 GB and 10 s. What falls short is
printed. ``--keep FILE --write`` writes the table of what was kept. Processes are forked: not on Windows.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from fingerlab.cli.main import COMMANDS
from tests.faults.crafted_sessions import SECRET, crafted_sessions, flipped
from tests.faults.crafted_texts import MODEL, Line, crafted_texts
from tests.faults.sweep import PAGE, with_part

LATE = ("scipy.io", "fingerlab.diagnosis.diagnose", "fingerlab.report.page", "fingerlab.batch.run")
MOST_MB, MOST_S = 1000.0, 10.0
LIMIT_S = 60
"""After which a command is ended: it hangs."""
SESSION_COMMANDS: dict[str, tuple[str, ...]] = {
    "info": ("info", "{F}", "--json", "out.json"),
    "export": ("export", "{F}", "--to", "csv", "--out", "exported"),
    "fit": ("fit", "{F}", "--method", "whole", "--json", "out.json"),
    "diagnose": ("diagnose", "{F}", "--json", "out.json"),
    "predict": ("predict", "{F}", "--model", "{D}/model.json", "--json", "out.json"),
    "compare": ("compare", "{F}", "--model", "{D}/model.json", "--json", "out.json"),
    "inverse": ("inverse", "{F}", "--model", "{D}/model.json", "--wanted", "{W}", "--json", "out.json"),
    "calibrate": ("calibrate", "{F}", "--sensor", "mcp", "--json", "out.json"),
    "reveal": ("reveal", "{F}", "--json", "out.json"),
    "report": ("report", "{F}", "--out", "out.html"),
}
"""What reads a session; {F} is the file, {D} its folder."""
ASKED_FOR = ("out.json", "out.html", "out.parquet", "exported", "out.h5")


@dataclass(frozen=True)
class Outcome:
    """What one command made of one file."""

    kind: str
    command: str
    code: int
    said: str
    megabytes: float
    seconds: float
    faults: tuple[str, ...]


def judged(kind: str, command: Sequence[str], folder: Path, path: Path) -> Outcome:
    """Give a file to a command in a process of its own, and say what is wrong with what it did."""
    wanted = {
        "{F}": str(path),
        "{D}": str(folder),
        "{W}": '{"kind": "sine", "mean_n": 1, "amplitude_n": 0.5}',
    }
    arguments = list(command)
    for mark, by in wanted.items():
        arguments = [word.replace(mark, by) for word in arguments]
    with tempfile.TemporaryDirectory() as place:
        before = _snapshot(folder)
        code, out, err, megabytes, seconds = _alone(arguments, Path(place))
        made = sorted(str(p.relative_to(place)) for p in Path(place).iterdir())
        told = out + err + "".join(_texts(Path(place)))
        faults = list(_faults(code, out, err))
        if (code != 0 and made) or any(name not in ASKED_FOR for name in made):
            faults.append(f"wrote {', '.join(made)}")
        if _snapshot(folder) != before and "says that it is open" not in kind:  # that one is repaired
            faults.append("changed the folder")
        if kind.startswith("way out") and code != 2:
            faults.append("followed")
        if SECRET in told:
            faults.append("told of another file")
        if "\x1b" in out + err or "\x9b" in out + err or "\u202e" in out + err:
            faults.append("terminal escapes")
        if megabytes > MOST_MB:
            faults.append(f"{megabytes:.0f} MB")
        if seconds > MOST_S:
            faults.append(f"{seconds:.0f} s")
    last = [line for line in err.splitlines() if line.startswith("fingerlab: ")]
    return Outcome(kind, command[0], code, (last or [""])[-1][:300], megabytes, seconds, tuple(faults))


def _faults(code: int, out: str, err: str) -> Iterator[str]:
    if code not in (0, 2):
        yield {-11: "SIGSEGV", -9: "hangs", -6: "SIGABRT", -7: "SIGBUS", -8: "SIGFPE"}.get(
            code, f"exit {code}"
        )
    if "Traceback" in err:
        yield err.strip().splitlines()[-1][:200]
    sentences = [line for line in err.splitlines() if line.startswith("fingerlab: ")]
    if code == 2:
        if len(sentences) != 1 or not err.rstrip().splitlines()[-1].startswith("fingerlab: "):
            yield "not one sentence"
        elif len(sentences[0]) > 1500:
            yield f"a sentence of {len(sentences[0])} letters"
    if "Warning" in err:
        yield next(line for line in err.splitlines() if "Warning" in line)[:200]


def _alone(arguments: Sequence[str], place: Path) -> tuple[int, str, str, float, float]:
    """Exit code, standard output and error, MB, and s of a command in a fork."""
    import signal

    begun = time.monotonic()
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        code = _in_child(arguments, place)
        os._exit(code)
    while True:
        ended, status, usage = os.wait4(child, os.WNOHANG)
        if ended:
            break
        if time.monotonic() - begun > LIMIT_S:
            os.killpg(child, signal.SIGKILL)
            _, status, usage = os.wait4(child, 0)
            break
        time.sleep(0.005)
    seconds = time.monotonic() - begun
    code = os.waitstatus_to_exitcode(status)
    out, err = ((place / name).read_text("utf-8", "replace") for name in (".out", ".err"))
    for name in (".out", ".err"):
        (place / name).unlink()
    return code, out, err, usage.ru_maxrss / 1024, seconds


def _in_child(arguments: Sequence[str], place: Path) -> int:
    from fingerlab.cli.main import main

    os.chdir(place)
    os.environ["FINGERLAB_SETTINGS_DIR"] = str(place / "..")
    for number, name in ((1, ".out"), (2, ".err")):
        os.dup2(os.open(name, os.O_CREAT | os.O_WRONLY), number)
    try:
        main(arguments)
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 1
    except BaseException:
        import traceback

        traceback.print_exc()
        return 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
    return 0


def _snapshot(folder: Path) -> dict[str, str]:
    def content(path: Path) -> str:
        if path.is_symlink() or not path.is_file():
            return "-"
        return hashlib.sha256(path.read_bytes()).hexdigest()

    return {str(path.relative_to(folder)): content(path) for path in folder.rglob("*")}


def _texts(place: Path) -> Iterator[str]:
    for path in place.rglob("*"):
        if path.is_file() and path.stat().st_size < 50_000_000:
            yield path.read_bytes().decode("utf-8", "replace")


def outcomes(
    only: str = "", flips: int = 0, commands: Sequence[str] = (), share: int = 1
) -> Iterator[Outcome]:
    """Every kind whose name holds ``only`` through every command that reads it; of these one in ``share``."""
    sessions: dict[str, Callable[[Path], None]] = dict(crafted_sessions())
    sessions |= {f"bytes turned: seed {seed}": partial(flipped, seed=seed) for seed in range(flips)}
    kinds: dict[str, tuple[Callable[[Path], Path], Sequence[Line]]] = {
        kind: (partial(_session, make=make), tuple(SESSION_COMMANDS.values()))
        for kind, make in sessions.items()
    }
    kinds |= crafted_texts()
    count = 0
    for kind, (make_file, every) in kinds.items():
        if only not in kind:
            continue
        lines = [line for line in every if not commands or line[0] in commands]
        first = -count % share
        count += len(lines)
        if not lines[first::share]:
            continue
        with tempfile.TemporaryDirectory() as name:
            path = make_file(Path(name))
            for line in lines[first::share]:
                yield judged(kind, line, Path(name), path)


def _session(folder: Path, make: Callable[[Path], None]) -> Path:
    (folder / "model.json").write_text(json.dumps(MODEL), encoding="utf-8")
    make(folder / "session.h5")
    return folder / "session.h5"


def table(found: Sequence[Outcome]) -> list[str]:
    """Rows of the page: a class of files a row."""
    rows = []
    for group in dict.fromkeys(group_of(one) for one in found):
        mine = [one for one in found if group_of(one) == group]
        kinds, commands = len({one.kind for one in mine}), len({one.command for one in mine})
        rows.append(
            f"| {group} | {kinds} | {commands} | {len(mine)} | {sum(one.code == 2 for one in mine)} | "
            f"{sum(one.code == 0 for one in mine)} | {sum(bool(one.faults) for one in mine)} | "
            f"{max(one.megabytes for one in mine):.0f} | {max(one.seconds for one in mine):.1f} |"
        )
    return rows


def group_of(outcome: Outcome) -> str:
    """The class of a kind: what stands before its colon."""
    return outcome.kind.partition(":")[0].partition(" with ")[0].partition(" /")[0].partition(" runs/")[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="kinds whose name holds this")
    parser.add_argument("--flips", type=int, default=0, help="how many sessions with bytes turned")
    parser.add_argument("--command", action="append", default=[], help="only these; repeatable")
    parser.add_argument(
        "--share", type=int, default=1, help="one in so many of all pairs of file and command"
    )
    parser.add_argument("--keep", type=Path, help="JSON lines of outcomes: added to")
    parser.add_argument("--write", action="store_true", help="write the page's table from what --keep has")
    parser.add_argument("--verbose", action="store_true", help="show what does not fall short, too")
    options = parser.parse_args()
    if options.write:
        lines = options.keep.read_text(encoding="utf-8").splitlines()
        found = [Outcome(**json.loads(line)) for line in lines]
        PAGE.write_text(with_part(PAGE.read_text(encoding="utf-8"), "crafted files", table(found)), "utf-8")
        return
    for module in (*(place.split(":")[0] for place, _ in COMMANDS.values()), *LATE):
        importlib.import_module(module)  # once for all commands
    count = 0
    for one in outcomes(options.only, options.flips, options.command, options.share):
        count += 1
        if one.faults or options.verbose:
            words = (
                one.kind,
                one.command,
                *one.faults,
                f"{one.megabytes:.0f} MB",
                f"{one.seconds:.1f} s",
                one.said,
            )
            print(" | ".join(words), flush=True)
        if options.keep:
            with options.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(one)) + "\n")
    print(count, "outcomes", file=sys.stderr)


if __name__ == "__main__":
    main()

"""Text files as a stranger could make them: rigs, mappings, tables, models, trajectories. See ``crafted.py``."""

# ruff: noqa: E501

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.conftest import RIG, write_plain_session

Line = tuple[str, ...]
Kinds = dict[str, tuple[Callable[[Path], Path], tuple[Line, ...]]]
"""Name -> what makes the file in a folder, and the command lines that read it ({F}, and {D} its folder)."""

BINARY: dict[str, bytes | None] = {
    "empty": b"",
    "binary": bytes(range(256)) * 20,
    "no UTF-8": b'{"a": "\xff"}',
    "zeros": bytes(5000),
    "17 MB": b" " * (17 << 20),
    "folder": None,
}
JSON_TEXTS = {
    "a list": "[1, 2]",
    "a number": "7",
    "null": "null",
    "a text": '"x"',
    "100 000 levels": "[" * 100_000 + "]" * 100_000,
    "200 levels": '{"a":' * 200 + "1" + "}" * 200,
    "number of 5000 digits": '{"kind": %s, "format": 1}' % ("9" * 5000),
    "number of 400 digits": '{"kind": %s, "format": 1}' % ("9" * 400),
    "1e999": '{"kind": 1e999}',
    "NaN": '{"kind": NaN}',
    "half a character": '{"kind": "\\ud800"}',
    "cut": '{"kind": "si',
    "escapes": '{"\x1b[2J": 1, "kind": "\\u001b]0;owned\\u0007"}',
    "markup": '{"kind": "[/bold]", "[/x]": 1}',
}
TOML_TEXTS = {
    "cut": "[finger\n",
    "a time": "made = 2024-05-06T07:08:09Z\n",
    "a list": "finger = [1]\n",
    "1000 levels": "a = " + "[" * 1000 + "]" * 1000 + "\n",
    "40 levels": "a = " + "[" * 40 + "]" * 40 + "\n",
    "key of 2000 parts": ".".join("a" * 2000) + " = 1\n",
    "number of 5000 digits": "[motor]\ngear_ratio = " + "9" * 5000 + "\n",
    "number of 400 digits": "[motor]\ngear_ratio = " + "9" * 400 + "\n",
    "hexadecimal number": "[motor]\ngear_ratio = 0x" + "f" * 1000 + "\n",
    "infinity": "[motor]\ngear_ratio = inf\n",
    "infinity elsewhere": "[other]\nx = inf\n",
    "NaN elsewhere": "other = nan\n",
    "unit of escapes": '[motor]\npulley_radius = {value = 1, unit = "\\u001b[2J"}\n',
    "escape in a key": '[motor]\n"\\u001b[2J" = 1\n',
    "sources a list": "sources = [1]\n",
    "rig of markup": '[motor]\n"[/bold]" = 1\n',
}
ODD_LEAVES: dict[str, Any] = {
    "null": None,
    "true": True,
    "text": "[/x]\x1b[2J",
    "list": [1],
    "section": {"a": {}},
    "minus one": -1,
    "zero": 0,
    "1e308": 1e308,
    "1e-308": 1e-308,
    "10^30": 10**30,
}
ROW = "{0:.3f}\t{0}\t{0}\t0.1\t1\t2\t3\n"
HEADER = "time (s)\tcommand (deg)\tposition (deg)\ttorque (Nm)\tMCP (deg)\tPIP (deg)\tforce (N)\n"
ROWS = "".join(ROW.format(number / 1000) for number in range(300))
TABLES = {
    "digits without end": "9" * 40_000 + "x\n" + ROWS,
    "40 KB of digits in each row": ("1" * 40_000 + "\t2\n") * 20,
    "points without end": "1." * 20_000 + "\n" + ROWS,
    "number of 5000 digits": ROWS + "9" * 5000 + "\t1" * 6 + "\n",
    "numbers beyond all": ROWS + "1e999\t1e999\t1\t1\t1\t1\t1\n",
    "times of 1e300": HEADER + "".join(f"{n}e300\t1\t1\t0.1\t1\t2\t3\n" for n in range(50)),
    "times 1e-320 apart": HEADER + "".join(f"{n}e-320\t1\t1\t0.1\t1\t2\t3\n" for n in range(50)),
    "one row": HEADER + "0\t1\t1\t0.1\t1\t2\t3\n",
    "10 000 columns": "\t".join(map(str, range(10_000))) + "\n" + "\t".join(["1"] * 10_000) + "\n",
    "one line of 5 MB": "1 " * 2_500_000 + "\n",
    "header of escapes": HEADER.replace("MCP (deg)", "\x1b]0;owned\x07 (deg)") + ROWS,
    "header that is a formula": "=cmd|'/c calc'!A1\t" + HEADER + "".join("1\t" + ROW.format(n / 1000) for n in range(50)),
    "header of markup": HEADER.replace("\n", "\t[/bold]\n") + "".join(ROW.format(n / 1000).replace("\n", "\t1\n") for n in range(50)),
    "header with words without end": HEADER.replace("force (N)", "a(" * 20_000) + ROWS,
    "spaces without end": " " * 200_000 + "x\n" + ROWS,
    "foreign digits": ROWS.replace("1", "١"),
    "underscores": ROWS.replace("0.1", "1_0"),
    "hexadecimal": ROWS.replace("0.1", "0x1"),
    "carriage returns": ROWS.replace("\n", "\r"),
    "form feeds": ROWS.replace("\n", "\f\n"),
    "zero in the middle": ROWS + "\0\0\n",
    "time that stands": HEADER + "0\t1\t1\t0.1\t1\t2\t3\n" * 50,
    "utf-16 cut": "",
}  # fmt: skip
TRAJECTORY = {"kind": "sine", "amplitude_deg": 15, "frequency_hz": 1, "offset_deg": 22, "duration_s": 2}
TRAJECTORIES: dict[str, Any] = {
    "a million periods": {**TRAJECTORY, "frequency_hz": 1e6},
    "a year": {**TRAJECTORY, "duration_s": 3e7},
    "1e308 s": {**TRAJECTORY, "duration_s": 1e308},
    "1e-308 s": {**TRAJECTORY, "duration_s": 1e-308},
    "list in a list": {"kind": "file", "time_s": [[0, 1], [2]], "angle_deg": [[1], [2, 3]]},
    "lists of texts": {"kind": "file", "time_s": ["a"], "angle_deg": ["b"]},
    "lists of 400 digits": {"kind": "file", "time_s": [0, 10**299], "angle_deg": [0, 10**299]},
    "a million tones": {"kind": "multisine", "amplitude_deg": 1, "frequencies_hz": [1] * 100_000},
    "steps without end": {"kind": "steps", "amplitude_deg": 5, "frequency_hz": 1e12},
    "chirp without end": {"kind": "chirp", "amplitude_deg": 5, "frequency_hz": 1e-300, "to_hz": 1e300},
    "kind a list": {"kind": []},
    "kind of escapes": {"kind": "\x1b[2J"},
    "file that is a pipe": {"kind": "file", "file": "/dev/zero"},
    "file that is a folder": {"kind": "file", "file": "/"},
    "file of zeros in its name": {"kind": "file", "file": "a\0b"},
    "trajectory in a trajectory": {"trajectory": {"trajectory": TRAJECTORY}},
    "next experiment a list": {"next_experiment": [1]},
    "phase a list": {"trajectory": TRAJECTORY, "phase": [1]},
    "cable a number": {"trajectory": TRAJECTORY, "cable": 3, "phase": "on_air"},
}
RIG_LINES = (
    ("devices", "--rig", "{F}"),
    ("import", "{D}/table.txt", "--rig", "{F}", "--out", "out.h5"),
    ("record", "--rig", "{F}", "--device", "simulated", "--trajectory", json.dumps(TRAJECTORY), "--phase", "free", "--cable", "none", "--yes", "--out", "out.h5"),
)  # fmt: skip
MODEL_LINES = tuple(
    (word, "{D}/s.h5", "--model", "{F}", *more, "--json", "out.json")
    for word, more in (("predict", ()), ("compare", ()), ("inverse", ("--wanted", '{"kind": "sine"}')))
)


def crafted_texts() -> Kinds:
    """Every kind of odd text file."""
    kinds: Kinds = {}
    readers: dict[str, tuple[str, tuple[Line, ...], dict[str, str]]] = {
        "rig": ("rig.toml", RIG_LINES, TOML_TEXTS),
        "mapping": ("map.toml", (("import", "{D}/table.txt", "--map", "{F}", "--out", "out.h5"),), TOML_TEXTS),
        "mapping in JSON": ("map.json", (("import", "{D}/table.txt", "--map", "{F}", "--out", "out.h5"),), JSON_TEXTS),
        "preset": ("bench.toml", (("simulate", "--preset", "{F}", "--protocol", "on-air", "--out", "out.h5"),), TOML_TEXTS),
        "model": ("model.json", MODEL_LINES[:1], JSON_TEXTS),
        "trajectory": ("t.json", (("simulate", "--trajectory", "{F}", "--phase", "on_air", "--cable", "extension", "--out", "out.h5"),), JSON_TEXTS),
        "wanted force": ("w.json", (("inverse", "{D}/s.h5", "--model", "{D}/good.json", "--wanted", "{F}"),), JSON_TEXTS),
        "commands": ("c.txt", (("record", "--device", "simulated", "--trajectory", json.dumps(TRAJECTORY), "--phase", "free", "--cable", "none", "--yes", "--commands", "{F}", "--out", "out.h5"),), JSON_TEXTS),
        "table": ("t.txt", (("import", "{F}", "--out", "out.h5"), ("calibrate", "{F}", "--sensor", "mcp")), TABLES),
    }  # fmt: skip
    for what, (name, lines, texts) in readers.items():
        for title, content in BINARY.items():
            kinds[f"{what}: {title}"] = (_written(name, content), lines)
        for title, text in texts.items():
            kinds[f"{what}: {title}"] = (_written(name, text.encode("utf-8", "surrogatepass")), lines)
        if hasattr(os, "mkfifo"):
            kinds[f"{what}: a pipe"] = (_pipe(name), lines)
            kinds[f"{what}: a device without end"] = (_device(name), lines)
    simulate = readers["trajectory"][1]
    for title, data in TRAJECTORIES.items():
        kinds[f"trajectory: {title}"] = (_written("t.json", json.dumps(data).encode()), simulate)
    for name in TRAJECTORY:
        for title, value in ODD_LEAVES.items():
            changed = json.dumps({**TRAJECTORY, name: value}).encode()
            kinds[f"trajectory with {name} = {title}"] = (_written("t.json", changed), simulate)
    for place in _leaves(MODEL):
        for title, value in ODD_LEAVES.items():
            changed = json.dumps(_with(MODEL, place, value)).encode()
            kinds[f"model with {'/'.join(map(str, place))} = {title}"] = (
                _written("model.json", changed),
                MODEL_LINES[:1],
            )
    return kinds


def _written(name: str, content: bytes | None) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        _beside(folder)
        path = folder / name
        if content is None:
            path.mkdir()
        else:
            path.write_bytes(content)
        return path

    return make


def _pipe(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        _beside(folder)
        os.mkfifo(folder / name)
        return folder / name

    return make


def _device(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        _beside(folder)
        (folder / name).symlink_to("/dev/zero")
        return folder / name

    return make


def _beside(folder: Path) -> None:
    """A good session, a good table and a good model."""
    write_plain_session(folder / "s.h5", samples=1500)
    (folder / "table.txt").write_text(HEADER + ROWS, encoding="utf-8")
    (folder / "good.json").write_text(json.dumps(MODEL), encoding="utf-8")


def _leaves(data: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place of plain data, the inner ones, too; of lists and many likes the first."""
    if place:
        yield place
    if isinstance(data, dict):
        for key, value in list(data.items())[:12]:
            yield from _leaves(value, (*place, key))
    elif isinstance(data, list) and data:
        yield from _leaves(data[0], (*place, 0))


def _with(data: Any, place: tuple[Any, ...], value: Any) -> Any:
    """The data with another value in a place."""
    if not place:
        return value
    copy = dict(data) if isinstance(data, dict) else list(data)
    copy[place[0]] = _with(data[place[0]], place[1:], value)
    return copy


MODEL: dict[str, Any] = {
    "format": "fingerlab-model",
    "format_version": "1",
    "software": "fingerlab 0.1.0",
    "created": "2024-05-06T07:08:09+02:00",
    "method": "regions",
    "effects": [],
    "sign_convention": "",
    "sessions": [{"name": "S.h5", "sha256": "0" * 64}],
    "parameters": {
        f"extension/{joint}/{region}/{name}": {"value": value, "unit": unit, "low": value, "high": value}
        for joint in ("mcp", "pip")
        for region in ("flexion", "extension")
        for name, value, unit in (("moment_arm", 0.01, "m"), ("loss", 0.001, "N m"))
    },
    "details": {"rig": RIG},
}

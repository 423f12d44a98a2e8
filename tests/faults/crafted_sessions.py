"""Session files as a stranger could make them: one odd thing each, some meant to harm. See ``crafted.py``."""

# ruff: noqa: E501

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.conftest import RIG, write_plain_session

Change = Callable[[h5py.File], None]
SECRET = "the-content-of-another-file"
"""Stands in files beside the session; nothing that a command says or writes may hold it."""

ODD_VALUES: dict[str, Any] = {
    "nothing": h5py.Empty("f8"),
    "empty text": "",
    "whole number": 7,
    "minus one": -1,
    "NaN": float("nan"),
    "infinity": float("inf"),
    "largest number": 1e308,
    "smallest number": 5e-324,
    "large whole number": np.uint64(2**64 - 1),
    "list of numbers": np.arange(3.0),
    "empty list": np.zeros(0),
    "list of texts": np.array(["a", "b"], dtype=object),
    "bytes that are no UTF-8": np.bytes_(b"\xff\xfe\x80 x"),
    "text with zeros in it": np.bytes_(b"a\0b\0"),
    "record": np.array([(1, 2.0)], dtype=[("a", "i4"), ("b", "f8")]),
    "complex": 1 + 2j,
    "long text": "x" * 60000,
    "number of 5000 digits": "9" * 5000,
    "JSON of 20 000 levels": "[" * 20000 + "]" * 20000,
    "JSON of 200 levels": '{"a":' * 200 + "1" + "}" * 200,
    "JSON with NaN": '{"kind": NaN, "motor": {"gear_ratio": NaN}}',
    "JSON beyond all numbers": '{"kind": 1e999, "motor": {"gear_ratio": 1e999}}',
    "JSON with a number of 400 digits": '{"kind": 9, "tolerance": {"a": 9}}'.replace("9", "9" * 400),
    "JSON with half a character": '{"kind": "\\ud800", "title": "\\ud800"}',
    "markup": "[/bold][link=file:///etc]x[/nothing]",
    "escapes": "\x1b]0;owned\x07\x1b[2J\x9b31m\u202etxt.exe\r\n",
    "page": "<img src=x onerror=alert(1)><script>1</script>{{7*7}}",
    "mathtext": "$\\frac{1}{$ \\unknown{ $x_{$",
    "LaTeX": "%\n\\input{/etc/passwd}\\end{document}",
    "formula": "=cmd|'/c calc'!A1",
}
ROOT_ATTRIBUTES = (
    "format",
    "format_version",
    "created",
    "title",
    "rig",
    "operator",
    "notes",
    "tags",
    "ended",
)
RUN_ATTRIBUTES = (
    "phase",
    "cable",
    "sample_rate_hz",
    "trajectory",
    "complete",
    "dropped_samples",
    "started",
    "markers",
    "derived",
)
RATES = (1e308, 1e-308, 0.0, 20.0, 10.0, 0.5, 1e9, 999.0)
RIG_TEXTS: dict[str, Any] = {
    "gear ratio 0": {"motor": {"gear_ratio": 0}},
    "torque constant 0": {"motor": {"torque_constant": 0}},
    "torque constant 1e308": {"motor": {"torque_constant": 1e308}},
    "pulley radius 0": {"motor": {"pulley_radius": 0}},
    "pulley radius -1": {"motor": {"pulley_radius": -1}},
    "inertia 1e308": {"motor": {"inertia": 1e308}},
    "massless finger": {"finger": {"proximal_mass": 0, "distal_mass": 0}},
    "heavy finger": {"finger": {"proximal_mass": 1e308}},
    "finger of no length": {"finger": {"proximal_half_length": 0, "distal_half_length": 0}},
    "negative stiffness": {"finger": {"mcp_stiffness": -1e300, "pip_stiffness": 0}},
    "wrist angle 1e300": {"finger": {"wrist_angle": 1e300}},
    "no gravity": {"finger": {"gravity": 0}},
    "finger a list": {"finger": [1, 2]},
    "motor a number": {"motor": 3},
    "tolerance null": {"tolerance": {"mcp_stiffness": None}},
    "tolerance a list": {"tolerance": {"mcp_stiffness": [1]}},
    "tolerance negative": {"tolerance": {"mcp_stiffness": -1}},
    "tolerance 1e308": {"tolerance": {"mcp_stiffness": 1e308}},
    "tolerance true": {"tolerance": {"mcp_stiffness": True}},
    "limits of words": {"limits": {"current": "much"}},
    "limits a list": {"limits": [1]},
    "daq a number": {"daq": 1},
    "sources a list": {"sources": [1]},
    "sources deep": {"sources": {"mcp_stiffness": {"a": [1, {"b": "[/]"}]}}},
}


def crafted_sessions() -> dict[str, Callable[[Path], None]]:
    """Name of a kind -> function that makes the file (and what it leads to, beside it)."""
    kinds: dict[str, Callable[[Path], None]] = {"good": _changed(lambda file: None)}
    for where, names in (("/", ROOT_ATTRIBUTES), ("runs/001", RUN_ATTRIBUTES)):
        for name in names:
            for title, value in ODD_VALUES.items():
                kinds[f"attribute {where}@{name}: {title}"] = _changed(_attribute(where, name, value))
    for rate in RATES:
        kinds[f"rate {rate:g} Hz"] = _changed(_attribute("runs/001", "sample_rate_hz", rate))
    for title, part in RIG_TEXTS.items():
        kinds[f"rig: {title}"] = _changed(_rig(part))
    kinds |= {f"structure: {name}": _changed(change) for name, change in STRUCTURES.items()}
    kinds |= {f"way out: {name}": make for name, make in WAYS_OUT.items()}
    kinds |= {f"file: {name}": make for name, make in FILES.items()}
    return kinds


def _changed(change: Change) -> Callable[[Path], None]:
    return lambda path: write_plain_session(path, change, samples=1500)


def _attribute(where: str, name: str, value: Any) -> Change:
    def change(file: h5py.File) -> None:
        file[where].attrs[name] = value

    return change


def _rig(part: dict[str, Any]) -> Change:
    def change(file: h5py.File) -> None:
        rig: dict[str, Any] = json.loads(json.dumps(RIG))
        for section, values in part.items():
            mixed = isinstance(values, dict) and isinstance(rig.get(section), dict)
            rig[section] = {**rig[section], **values} if mixed else values
        file.attrs["rig"] = json.dumps(rig)

    return change


def _no_title_scale(file: h5py.File) -> None:
    del file["runs/001/time"].attrs["CLASS"]


def _replaced(name: str, **how: Any) -> Change:
    """The channel ``mcp_angle`` made anew."""

    def change(file: h5py.File) -> None:
        group = file["runs/001"]
        unit = group[name].attrs["units"]
        length = len(group[name])
        del group[name]
        options = {"shape": (length,), "dtype": "f4", **how}
        group.create_dataset(name, **options).attrs["units"] = unit

    return change


def _all_made(length: int, fill: bool, **how: Any) -> Change:
    """Every channel of both runs with ``length`` samples; time increases by its fill alone: not at all."""

    def change(file: h5py.File) -> None:
        for run in file["runs"].values():
            for name in list(run):
                unit = run[name].attrs["units"]
                del run[name]
                dataset = run.create_dataset(name, shape=(length,), dtype="f4", **how)
                dataset.attrs["units"] = unit
                if fill:
                    dataset[...] = np.arange(length) / 1000 if name == "time" else 0.0

    return change


def _bomb(file: h5py.File) -> None:
    """80 MB of samples that are nearly free in the file, time included."""
    length = 2_500_000
    for run in file["runs"].values():
        for name in list(run):
            unit = run[name].attrs["units"]
            del run[name]
            values = np.arange(length) / 1000 if name == "time" else np.zeros(length)
            made = run.create_dataset(
                name, data=values, chunks=(length,), compression="gzip", compression_opts=9, shuffle=True
            )
            made.attrs["units"] = unit


def _many_runs(file: h5py.File) -> None:
    run, runs = file["runs/001"].id, file["runs"].id
    for number in range(3, 20_000):
        h5py.h5o.link(run, runs, b"%d" % number)


def _many_channels(file: h5py.File) -> None:
    channel, run = file["runs/001/mcp_angle"].id, file["runs/001"].id
    for number in range(20_000):
        h5py.h5o.link(channel, run, b"more_%d" % number)


def _many_empty_runs(file: h5py.File) -> None:
    for number in range(3, 5000):
        file.create_group(f"runs/{number:05d}")


def _many_attributes(file: h5py.File) -> None:
    group = file["runs/001"]
    for number in range(2_000):
        group.attrs[f"a{number}"] = number


def _heavy_attribute(file: h5py.File) -> None:
    kind = h5py.string_dtype("utf-8")
    file.attrs.create("notes", np.array(["y" * 2000] * 4000, dtype=object), dtype=kind)


def _loop(file: h5py.File) -> None:
    file["runs/001/again"] = file["runs"]
    file["self"] = file["/"]


def _soft_loop(file: h5py.File) -> None:
    file["runs/003"] = h5py.SoftLink("/runs/003")


def _deep(file: h5py.File) -> None:
    group = file
    for _ in range(2000):
        group = group.create_group("g")


def _references(file: h5py.File) -> None:
    file.attrs["notes"] = file["runs/001"].ref
    file["refs"] = np.array([file["runs/001"].ref], dtype=h5py.ref_dtype)


def _named_type(file: h5py.File) -> None:
    file["runs/001/kind"] = np.dtype("f8")
    file["runs/003"] = np.dtype("i4")


def _odd_units(file: h5py.File) -> None:
    for name, value in (("extra_a", [1, 2]), ("extra_b", b"\xff"), ("extra_c", h5py.Empty("f4"))):
        made = file["runs/001"].create_dataset(name, data=np.zeros(1500))
        made.attrs["units"] = value


def _unit_of_two(file: h5py.File) -> None:
    file["runs/001/time"].attrs["units"] = np.array(["s", "ms"], dtype=object)


def _no_unit_text(file: h5py.File) -> None:
    file["runs/001/mcp_angle"].attrs["units"] = h5py.Empty("S3")


NAMES = {
    "with a line break": "a\nb",
    "with an escape": "\x1b[31m",
    "a formula": "=1+1",
    "with a separator": 'a,"b\t',
    "markup": "[b][link=x]",
    "page": "<b>x",
    "mathtext": "$x_{$",
    "very long": "n" * 5000,
    "dots": "..",
    "drive": "C:\\x",
    "no text": b"\xff\xfe".decode("utf-8", "surrogateescape"),
}


def _channel_named(name: str) -> Change:
    def change(file: h5py.File) -> None:
        raw = name.encode("utf-8", "surrogateescape")
        h5py.h5o.link(file["runs/001/mcp_angle"].id, file["runs/001"].id, raw)

    return change


def _run_named(name: str) -> Change:
    def change(file: h5py.File) -> None:
        raw = name.encode("utf-8", "surrogateescape")
        h5py.h5o.link(file["runs/001"].id, file["runs"].id, raw)

    return change


STRUCTURES: dict[str, Change] = {
    "chunk of 800 MB": _replaced("mcp_angle", maxshape=(None,), chunks=(200_000_000,)),
    "chunk of 800 MB, compressed": _replaced("mcp_angle", maxshape=(None,), chunks=(200_000_000,), compression="gzip"),
    "10^12 samples that are not there": _all_made(10**12, False, chunks=(1 << 20,)),
    "10^9 samples that are not there": _all_made(10**9, False, chunks=(1 << 20,)),
    "samples that unpack to 200 times the file": _bomb,
    "20 000 names of one run": _many_runs,
    "20 000 names of one channel": _many_channels,
    "5 000 empty runs": _many_empty_runs,
    "2 000 attributes": _many_attributes,
    "attribute of 4 000 texts": _heavy_attribute,
    "group in itself": _loop,
    "link to itself": _soft_loop,
    "2 000 groups deep": _deep,
    "references": _references,
    "named types": _named_type,
    "odd units of extras": _odd_units,
    "two units": _unit_of_two,
    "no unit's text": _no_unit_text,
    "complex samples": _replaced("mcp_angle", dtype="c8"),
    "whole numbers": _replaced("mcp_angle", dtype="i8"),
    "truth values": _replaced("mcp_angle", dtype="?"),
    "samples of texts": _replaced("mcp_angle", dtype=h5py.string_dtype()),
    "samples of records": _replaced("mcp_angle", dtype=[("a", "f4")]),
    "samples of lists": _replaced("mcp_angle", dtype=h5py.vlen_dtype("f4")),
    "samples of enumerations": _replaced("mcp_angle", dtype=h5py.enum_dtype({"a": 1}, "i4")),
    "half precision": _replaced("mcp_angle", dtype="f2"),
    "big-endian": _replaced("mcp_angle", dtype=">f8"),
    "long double": _replaced("mcp_angle", dtype=np.longdouble),
    "scalar channel": _replaced("mcp_angle", shape=()),
    "two-dimensional": _replaced("mcp_angle", shape=(1500, 1)),
    "no shape": lambda file: file["runs/001"].__setitem__("extra", h5py.Empty("f4")),
    "time without scale": _no_title_scale,
    "channel is a group": lambda file: (file["runs/001"].pop("mcp_angle"), file["runs/001"].create_group("mcp_angle"))[0],
    "run is a dataset": lambda file: file["runs"].__setitem__("003", np.zeros(3)),
    "runs is a dataset": lambda file: (file.pop("runs"), file.__setitem__("runs", np.zeros(3)))[0],
    "raw is a dataset": lambda file: file["runs/001"].__setitem__("raw", np.zeros(1500)),
    "raw is the run": lambda file: file["runs/001"].__setitem__("raw", file["runs/001"]),
    "run of one sample": lambda file: _one_sample(file, 1),
    "run of two samples": lambda file: _one_sample(file, 2),
    "run of 300 samples": lambda file: _one_sample(file, 300),
    "times of 1e300 s": lambda file: _times(file, 1e300),
    "times 1e-300 s apart": lambda file: _times(file, 1e-300),
    "torque 1e30": lambda file: _scaled(file, "motor_torque", 1e30),
    "current 1e30": lambda file: _scaled(file, "motor_current", 1e30),
    "angles 1e30": lambda file: _scaled(file, "mcp_angle", 1e30),
    "position 1e38": lambda file: _scaled(file, "motor_position", 1e38),
    "all zero": lambda file: _all_zero(file),
    "force infinite": lambda file: _scaled(file, "endpoint_force", np.inf),
    "run of 5000 digits": _run_named("9" * 5000),
    "run of foreign digits": _run_named("٠٠٣"),
    "run of raised digits": _run_named("²"),
    **{f"channel named: {name}": _channel_named(text) for name, text in NAMES.items()},
    **{f"run named: {name}": _run_named(text) for name, text in NAMES.items()},
}  # fmt: skip


def _one_sample(file: h5py.File, count: int) -> None:
    for run in file["runs"].values():
        for name in list(run):
            values, unit = run[name][:count], run[name].attrs["units"]
            del run[name]
            run[name] = values
            run[name].attrs["units"] = unit


def _times(file: h5py.File, step: float) -> None:
    for run in file["runs"].values():
        run["time"][...] = np.arange(len(run["time"])) * (step / len(run["time"]))


def _all_zero(file: h5py.File) -> None:
    for name in file["runs/001"]:
        if name != "time":
            _scaled(file, name, 0.0)


def _scaled(file: h5py.File, name: str, by: float) -> None:
    with np.errstate(all="ignore"):
        for run in file["runs"].values():
            run[name][...] = np.nan_to_num(run[name][...]) * by


def _secret(folder: Path) -> Path:
    """Another session that is nobody's business, and a plain file of bytes."""
    folder.mkdir(exist_ok=True)
    other = folder / "other.h5"
    if not other.exists():
        write_plain_session(other, lambda file: file.attrs.__setitem__("title", SECRET), samples=1500)
        (folder / "bytes").write_bytes(SECRET.encode().ljust(6000))
    return other


def _external(at: str, target: str, file_name: str = "outside/other.h5") -> Callable[[Path], None]:
    def make(path: Path) -> None:
        _secret(path.parent / "outside")

        def change(file: h5py.File) -> None:
            file.pop(at, None)
            file[at] = h5py.ExternalLink(file_name, target)

        write_plain_session(path, change, samples=1500)

    return make


def _to_pipe(path: Path) -> None:
    if hasattr(os, "mkfifo"):
        os.mkfifo(path.parent / "pipe")
    _external("extra", "/x", "pipe")(path)


def _stored_outside(at: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        _secret(path.parent / "outside")

        def change(file: h5py.File) -> None:
            file.pop(at, None)
            name = str(path.parent / "outside" / "bytes")
            made = file.create_dataset(at, (1500,), "f4", external=[(name, 0, 6000)])
            made.attrs["units"] = "rad"

        write_plain_session(path, change, samples=1500)

    return make


def _virtual(at: str, source: str, dataset: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        _secret(path.parent / "outside")

        def change(file: h5py.File) -> None:
            file.pop(at, None)
            layout = h5py.VirtualLayout((1500,), "f4")
            layout[:] = h5py.VirtualSource(source.replace("SELF", path.name), dataset, (1500,))
            made = file.create_virtual_dataset(at, layout, fillvalue=0)
            made.attrs["units"] = "rad"

        write_plain_session(path, change, samples=1500)

    return make


def _virtual_growing(path: Path) -> None:
    """A virtual dataset without end, whose extent is looked up in files of a pattern."""
    _secret(path.parent / "outside")

    def change(file: h5py.File) -> None:
        layout = h5py.VirtualLayout((1500,), "f4", maxshape=(None,))
        source = h5py.VirtualSource("outside/other.h5", "runs/001/mcp_angle", (1500,), maxshape=(None,))
        layout[: h5py.h5s.UNLIMITED] = source[: h5py.h5s.UNLIMITED]
        file.create_virtual_dataset("runs/001/more", layout)

    write_plain_session(path, change, samples=1500)


PLACES = (
    "runs/001",
    "runs/001/mcp_angle",
    "runs/001/time",
    "runs/001/raw",
    "runs/001/extra",
    "extra",
    "runs",
)
CHANNELS = ("runs/001/mcp_angle", "runs/001/time", "runs/001/raw/load_cell", "runs/001/extra", "a/b/c")
WAYS_OUT: dict[str, Callable[[Path], None]] = {
    **{f"link at {at}": _external(at, at if at in ("runs", "runs/001") else "runs/001/mcp_angle") for at in PLACES},
    "link deep in an extra group": _external("a/b/c/d", "/"),
    "link in raw": _external("runs/001/raw/load_cell", "runs/001/mcp_angle"),
    "link to a pipe": _to_pipe,
    "link to nothing": _external("extra", "/x", "missing.h5"),
    "link to itself": _external("runs/003", "/runs/003", "session.h5"),
    **{f"stored outside at {at}": _stored_outside(at) for at in CHANNELS},
    **{f"virtual at {at}": _virtual(at, "outside/other.h5", "runs/001/mcp_angle") for at in CHANNELS},
    "virtual that names itself": _virtual("runs/001/mcp_angle", "SELF", "runs/001/mcp_angle"),
    "virtual that names itself by a dot": _virtual("runs/001/mcp_angle", ".", "runs/001/mcp_angle"),
    "virtual of the same file": _virtual("runs/001/extra", ".", "runs/001/pip_angle"),
    "virtual of a missing file": _virtual("runs/001/mcp_angle", "missing.h5", "x"),
    "virtual of a missing file, as time": _virtual("runs/001/time", "missing.h5", "x"),
    "virtual without end": _virtual_growing,
}  # fmt: skip


def _bytes(content: bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(content) and None


def _cut(share: float) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        write_plain_session(path, samples=1500)
        content = path.read_bytes()
        path.write_bytes(content[: int(len(content) * share)])

    return make


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _flag(number: int, value: int) -> Callable[[Path], None]:
    """One byte of a file of the latest kind: its flag 'a writer has it open' among them."""

    def make(path: Path) -> None:
        write_plain_session(path, samples=1500, libver="latest")
        content = bytearray(path.read_bytes())
        content[number] = value
        path.write_bytes(content)

    return make


FILES: dict[str, Callable[[Path], None]] = {
    "empty": _bytes(b""),
    "head alone": _bytes(b"\x89HDF\r\n\x1a\n"),
    "head and zeros": _bytes(b"\x89HDF\r\n\x1a\n" + bytes(4000)),
    "head and ones": _bytes(b"\x89HDF\r\n\x1a\n" + b"\xff" * 4000),
    "text": _bytes(b"time\tangle\n0\t1\n"),
    "folder": lambda path: path.mkdir(),
    "link to a device": lambda path: path.symlink_to("/dev/zero"),
    "link to itself": lambda path: path.symlink_to(path.name),
    "says that it is open": _flag(11, 0x05),
    "says that it is of version 3": _flag(8, 3),
    "says that it is of version 250": _flag(8, 250),
    **{f"cut at {share:.0%}": _cut(share) for share in (0.01, 0.1, 0.3, 0.6, 0.9, 0.99)},
}
if hasattr(os, "mkfifo"):
    FILES["pipe"] = _pipe


def flipped(path: Path, seed: int) -> None:
    """A good session with 1 to 20 of its bytes turned; most near objects' headers, some anywhere."""
    write_plain_session(path, samples=300)
    content = bytearray(path.read_bytes())
    chance = np.random.default_rng(seed)
    count = int(chance.integers(1, 21))
    reach = 4096 if seed % 2 else len(content)
    for place in chance.integers(8, reach, count):
        content[place] = int(chance.integers(0, 256))
    path.write_bytes(content)

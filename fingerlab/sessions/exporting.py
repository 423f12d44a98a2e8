"""A session copied whole, or given to other tools: CSV, text, Parquet or MATLAB.

Beside the files for other tools stand ``NAME.json`` with everything that is not a sample, and, where the
session holds groups or datasets that the format does not know, ``NAME-extra.h5`` with those as they were.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from fingerlab.core.errors import UserError
from fingerlab.core.files import OutputSet, new_file
from fingerlab.core.plain_data import json_ready
from fingerlab.core.progress import Progress
from fingerlab.sessions.disk_files import TargetFile, content_hash
from fingerlab.sessions.hdf5 import open_hdf5, write_attributes, writing_to
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.sessions.reading import open_session


def copy_session(source: str | Path, target: str | Path, attributes: Mapping[str, Any] | None = None) -> Path:
    """Copy a session file as it is, after checking its structure.

    Args:
        attributes: root attributes to set in the copy, such as ``title`` and ``tags``; the rest stays.

    Returns:
        The path of the copy.

    Raises:
        UserError: the source is no session, or the target exists, cannot be written to or is full.
    """
    source, target = Path(source), Path(target)
    open_session(source)
    if attributes:
        with edited_copy(source, target) as copy:
            write_attributes(copy, attributes)
    else:
        with new_file(target) as part, writing_to(target):
            shutil.copyfile(source, part)
    return target


@contextmanager
def edited_copy(source: Path, target: Path) -> Iterator[h5py.File]:
    """A copy of a session, open to be changed; it gets its name once it has been and is still a session.

    Raises:
        UserError: the target exists, cannot be written to or is full, or what was changed broke the session.
    """
    with new_file(target) as part:
        with writing_to(target):
            shutil.copyfile(source, part)
            file = TargetFile(part)
        with writing_to(target, file):
            try:
                with h5py.File(file, "r+") as session:
                    yield session
            finally:
                file.close()
        # An attribute such as a broken rig text must not turn a good session into a bad one.
        open_session(part)


_NO_FILE_NAME = re.compile(r'[<>:"/\\|?*]')
FORMATS = ("csv", "mat", "parquet", "txt")
PIECE_SAMPLES = 1 << 17
"""Samples written together."""


def export_session(
    session: Session, kind: str, folder: str | Path, progress: Progress | None = None
) -> list[Path]:
    """Write a session for other tools. Numbers are SI, in double precision, written so that they come back.

    Args:
        kind: one of :data:`FORMATS`.
        folder: where to; made where it is missing.
        progress: called with the share done (0 to 1) and what is being written.

    Returns:
        The files written.

    Raises:
        UserError: unknown kind, a file exists already, or the place cannot be written to or is full;
            nothing is left behind.
    """
    if kind not in FORMATS:
        raise UserError(f"There is no export to {kind!r}; choose one of {', '.join(FORMATS)}.")
    folder = Path(folder)
    stem = session.path.stem
    written: list[Path] = []
    with OutputSet() as out, writing_to(folder):
        out.make_folder(folder)

        def place(name: str) -> Path:
            written.append(folder / name)
            return out.claim(folder / name)

        metadata_part = place(f"{stem}.json")
        files: dict[str, str] = {}
        if kind == "mat":
            files = {run.name: f"{stem}.mat" for run in session.runs}
            _write_mat(session, place(f"{stem}.mat"), progress)
        else:
            for number, run in enumerate(session.runs):
                if progress:
                    progress(number / len(session.runs), f"run {run.name}")
                files[run.name] = f"{stem}-{_NO_FILE_NAME.sub('_', run.name)}.{kind}"
                _WRITERS[kind](session, run, place(files[run.name]))
        if has_extras(session):
            _write_extras(session, place(f"{stem}-extra.h5"))
        metadata = session_metadata(session, files)
        metadata_part.write_text(json.dumps(metadata, indent=1, ensure_ascii=False), encoding="utf-8")
    return written


def session_metadata(session: Session, files: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Everything of a session that is not a sample, ready for ``json.dumps``.

    Args:
        files: the file that holds each run's samples, by run name.
    """
    runs = []
    for run in session.runs:
        runs.append(
            {
                "name": run.name,
                "file": (files or {}).get(run.name),
                "phase": run.phase,
                "cable": run.cable,
                "sample_rate_hz": run.sample_rate_hz,
                "trajectory": dict(run.trajectory),
                "samples": run.length,
                "units": dict(run.units),
                "attributes": dict(run.attributes),
            }
        )
    data = {
        "session": session.path.name,
        "sha256": content_hash(session),
        "title": session.title,
        "created": session.created,
        "rig": json.loads(session.rig.to_json()),
        "attributes": {key: value for key, value in session.attributes.items() if key != "rig"},
        "runs": runs,
    }
    result: dict[str, Any] = json_ready(data, unknown=str)
    return result


def column_title(name: str, unit: str) -> str:
    """A column's header, such as ``mcp_angle (rad)``; 'fingerlab import' understands it."""
    title = f"{name} ({unit})" if unit else name
    return f"'{title}" if title.startswith(("=", "+", "-", "@")) else title  # no formula of a spreadsheet


def _pieces(run: Run) -> Iterator[dict[str, Array]]:
    for start in range(0, run.length, PIECE_SAMPLES):
        yield run.load(None, start, start + PIECE_SAMPLES)


def _write_delimited(_: Session, run: Run, part: Path, delimiter: str) -> None:
    titles = [column_title(name, unit) for name, unit in run.units.items()]
    if any(delimiter in title or '"' in title for title in titles):
        raise UserError(
            f"Run {run.name} has a channel whose name or unit holds a separator; export to parquet."
        )
    schema = pa.schema([(title, pa.float64()) for title in titles])
    options = pa.csv.WriteOptions(delimiter=delimiter, quoting_style="none", quoting_header="none")
    with pa.csv.CSVWriter(part, schema, write_options=options) as writer:
        for piece in _pieces(run):
            writer.write_batch(
                pa.record_batch([pa.array(values) for values in piece.values()], schema=schema)
            )


def _write_parquet(session: Session, run: Run, part: Path) -> None:
    fields = [pa.field(name, pa.float64(), metadata={"units": unit}) for name, unit in run.units.items()]
    about = {
        "phase": run.phase,
        "cable": run.cable,
        "sample_rate_hz": repr(run.sample_rate_hz),
        "trajectory": json.dumps(dict(run.trajectory)),
        "session": session.path.name,
        "run": run.name,
    }
    schema = pa.schema(fields, metadata=about)
    with pa.parquet.ParquetWriter(part, schema) as writer:
        for piece in _pieces(run):
            writer.write_batch(
                pa.record_batch([pa.array(values) for values in piece.values()], schema=schema)
            )


def _write_mat(session: Session, part: Path, progress: Progress | None) -> None:
    """One struct a run (``run_001.mcp_angle``), and ``session`` with title, rig and attributes."""
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    runs: dict[str, Any] = {}
    for number, run in enumerate(session.runs):
        if progress:
            progress(number / len(session.runs), f"run {run.name}")
        struct: dict[str, Any] = {
            "phase": run.phase,
            "cable": run.cable,
            "sample_rate_hz": run.sample_rate_hz,
            "trajectory": json.dumps(dict(run.trajectory)),
            "units": {_matlab_name(name): unit for name, unit in run.units.items()},
        }
        for name, values in run.load().items():
            struct[_matlab_name(name)] = values
        runs[f"run_{_matlab_name(run.name)}"] = struct
    session_struct = {
        "title": session.title,
        "created": session.created,
        "rig": session.rig.to_json(),
        "metadata": json.dumps(session_metadata(session), ensure_ascii=False),
    }
    try:
        with part.open("wb") as file:
            savemat(
                file,
                {"session": session_struct, **runs},
                long_field_names=True,
                do_compression=True,
                oned_as="column",
            )
    except MatWriteError as error:
        raise UserError(
            f"{session.path} does not fit a .mat file ({error}); MATLAB reads the session itself with h5read."
        ) from None


def _matlab_name(name: str) -> str:
    """Letters, digits and underscores, at most 63: ``raw/load_cell`` becomes ``raw_load_cell``."""
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in name)[:63]


def has_extras(session: Session) -> bool:
    """Whether the file holds groups or datasets that are no channels of its runs."""
    with open_hdf5(session.path) as file:
        return bool(_extra_paths(session, file))


def _extra_paths(session: Session, file: h5py.File) -> list[str]:
    """Paths of everything that the export of samples leaves out, outermost first."""
    paths = [name for name in file if name != "runs"]
    for run in session.runs:
        group = file["runs"][run.name]
        for name, item in group.items():
            if name == "raw" and isinstance(item, h5py.Group):
                paths += [f"runs/{run.name}/raw/{key}" for key in item if f"raw/{key}" not in run.units]
            elif name not in run.units:
                paths.append(f"runs/{run.name}/{name}")
    return paths


def _write_extras(session: Session, part: Path) -> None:
    target = TargetFile(part)
    try:
        with open_hdf5(session.path) as file, h5py.File(target, "w") as extras:
            for path in _extra_paths(session, file):
                parent = extras.require_group(path.rpartition("/")[0] or "/")
                # References to the time axis stay behind with it.
                file.copy(file[path], parent, name=path.rpartition("/")[2], expand_refs=False)
    finally:
        target.close()
    with writing_to(part, target):
        pass


_WRITERS: dict[str, Callable[[Session, Run, Path], None]] = {
    "csv": partial(_write_delimited, delimiter=","),
    "txt": partial(_write_delimited, delimiter="\t"),
    "parquet": _write_parquet,
}

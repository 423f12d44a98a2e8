"""Python files found in a folder: a catalogue of our own, and files of the user that they confirmed.

A file runs only with a content that its user was asked about. What a file of each kind has to offer is
checked where it is used (``effects/own.py``, ``devices/choosing.py``).
"""

from __future__ import annotations

import hashlib
import json
import os
import pkgutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text, whole_file
from fingerlab.core.plain_data import parsed, structured


def found_in(paths: Iterable[str], package: str, order: Sequence[str]) -> dict[str, Any]:
    """The object ``EFFECT`` of every module that has one, by its id.

    Args:
        paths: folders of the package. package: its dotted name.
        order: ids that come first, in this order; the others come behind them by id.
    """
    modules = (import_module(f"{package}.{info.name}") for info in pkgutil.iter_modules(paths))
    found = {one.EFFECT.id: one.EFFECT for one in modules if hasattr(one, "EFFECT")}
    places = {name: place for place, name in enumerate(order)}
    names = sorted(found, key=lambda name: (places.get(name, len(places)), name))
    return {name: found[name] for name in names}


SETTINGS_VARIABLE = "FINGERLAB_SETTINGS_DIR"
"""Environment variable that puts the settings into another folder than the system's usual one."""

Kind = Literal["effects", "devices"]
"""What the files add. Who lets a file be run as one has not let it be run as the other."""

State = Literal["trusted", "waiting", "changed"]
"""This content was confirmed; none of this file was; another content of it was."""


@dataclass(frozen=True)
class OwnSource:
    """A file's whole name and the bytes that are hashed, confirmed and run: the same ones throughout."""

    file: str
    content: bytes
    state: State = field(default="waiting", compare=False)

    @property
    def sha256(self) -> str:
        return hashlib.sha256(self.content).hexdigest()

    @property
    def path(self) -> Path:
        return Path(self.file)


@dataclass(frozen=True)
class OwnSettings:
    """``folder``: where own effects are looked for (None: nowhere); devices are named one by one.

    ``trusted``: SHA-256 of the contents that the user has confirmed -> name of the file that held them then,
    in the order in which they were confirmed.
    """

    folder: Path | None = None
    trusted: Mapping[str, str] = field(default_factory=dict)


def settings_file(kind: Kind = "effects") -> Path:
    """The file in which own files of a kind are remembered, whether it is there yet or not."""
    name = f"own-{kind}.json"
    given = os.environ.get(SETTINGS_VARIABLE)
    if given:
        return Path(given) / name
    from platformdirs import user_config_path

    return user_config_path("FingerLab", appauthor=False) / name


def read_settings(kind: Kind = "effects") -> OwnSettings:
    """What is remembered; nothing where nothing was ever set.

    Raises:
        UserError: the file is damaged or cannot be read.
    """
    path = settings_file(kind)
    if not path.exists():
        return OwnSettings()
    text = read_text(path, f"it back, or {_REPAIR[kind]}")
    try:
        stored = structured(_Stored, parsed(text))
        if stored.format != _format(kind):
            raise ValueError(f"its format is {stored.format!r}")
    except ValueError as error:
        raise UserError(f"{path} is damaged ({error}); {_REPAIR[kind]}.") from None
    return OwnSettings(None if stored.folder is None else Path(stored.folder), stored.trusted)


@dataclass(frozen=True)
class _Stored:
    """The file as it is."""

    format: str
    folder: str | None
    trusted: dict[str, str]


_REPAIR: Mapping[Kind, str] = {
    "effects": "remove it and choose the folder of your own effects anew with "
    "'fingerlab effects --folder DIR'",
    "devices": "remove it and choose your own device anew",
}


def _format(kind: Kind) -> str:
    return f"fingerlab-own-{kind}"


def write_settings(settings: OwnSettings, kind: Kind = "effects") -> None:
    """Remember these; the file changes whole or not at all.

    Raises:
        UserError: the place cannot be written to.
    """
    path = settings_file(kind)
    folder = None if settings.folder is None else str(settings.folder)
    data = {"format": _format(kind), "folder": folder, "trusted": dict(settings.trusted)}
    with whole_file(path, f"set {SETTINGS_VARIABLE} to a folder that can be.") as part:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def with_state(source: OwnSource, settings: OwnSettings) -> OwnSource:
    """The source and what is remembered of it."""
    if source.sha256 in settings.trusted:
        return replace(source, state="trusted")
    return replace(source, state="changed" if source.file in settings.trusted.values() else "waiting")


def confirm(source: OwnSource, kind: Kind) -> None:
    """Remember that its user lets exactly this content be run. Call it only after they were asked.

    Raises:
        UserError: the settings cannot be read or written.
    """
    settings = read_settings(kind)
    others = {key: name for key, name in settings.trusted.items() if key != source.sha256}
    write_settings(replace(settings, trusted={**others, source.sha256: source.file}), kind)


def confirmed_names(kind: Kind) -> tuple[str, ...]:
    """Every file of which a content was ever confirmed, latest first.

    Raises:
        UserError: the settings are damaged.
    """
    return tuple(dict.fromkeys(reversed([*read_settings(kind).trusted.values()])))


def forget_file(file: str, kind: Kind) -> bool:
    """Forget that contents of this file were confirmed; it is asked about again before it is run.

    Args:
        file: its whole path.

    Returns:
        Whether any was.

    Raises:
        UserError: the settings cannot be read or written.
    """
    settings = read_settings(kind)
    kept = {sha256: name for sha256, name in settings.trusted.items() if name != file}
    if len(kept) < len(settings.trusted):
        write_settings(replace(settings, trusted=kept), kind)
    return len(kept) < len(settings.trusted)


def run_source(source: OwnSource, name: str) -> ModuleType:
    """Run the bytes of a file as a module of this name; whatever goes wrong in it comes out as it is.

    What it prints goes to standard error, so that it does not get between a command's results.
    """
    module = ModuleType(name)
    module.__file__ = source.file
    sys.modules[name] = module  # data classes and pickle look their module up
    try:
        with redirect_stdout(sys.stderr):
            exec(compile(source.content, source.file, "exec"), module.__dict__)
    except (Exception, SystemExit):
        del sys.modules[name]
        raise
    return module


def said(error: BaseException) -> str:
    """An exception of the user's code in a few words, without a stop at the end."""
    what = error.msg if isinstance(error, SyntaxError) else str(error)
    return " ".join(f"{type(error).__name__}: {what}".split()).rstrip(".: ")


def error_with_line(error: BaseException, file: str) -> str:
    """The same with the line of their file."""
    line = error.lineno if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == file:
            line = trace.tb_lineno
        trace = trace.tb_next
    return f"{file}{'' if line is None else f', line {line}'}: {said(error)}"

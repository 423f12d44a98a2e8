"""A device of one's own: a Python file with one class that keeps to the protocol.

The file is run where it is named, and nowhere else: it moves a motor, and should have been read by whoever
names it. Who writes ``own:FILE`` in a command has named it; where it is chosen from a list, as in the window,
:func:`confirm` remembers that its user let exactly this content be run.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Literal

from fingerlab.core.errors import UserError
from fingerlab.core.own_settings import OwnSettings, forget_file, read_settings, write_settings
from fingerlab.devices.protocol import Device

CALLS = ("open", "start", "set_enable", "exchange", "make_safe", "close")
"""What a class needs beside ``name`` and ``rate_hz`` to be taken for a device."""


State = Literal["confirmed", "new", "changed"]


@dataclass(frozen=True)
class DeviceFile:
    """A file as it was read, and whether its user has confirmed this content, another one, or none."""

    path: Path
    content: bytes
    state: State

    @property
    def sha256(self) -> str:
        return hashlib.sha256(self.content).hexdigest()


def device_file(path: Path) -> DeviceFile:
    """A file that is chosen; it is read, not run.

    Raises:
        UserError: it cannot be read, or the settings are damaged.
    """
    path = path.resolve()
    read, trusted = DeviceFile(path, _content(path), "new"), read_settings("devices").trusted
    if read.sha256 in trusted:
        return replace(read, state="confirmed")
    if str(path) in trusted.values():
        return replace(read, state="changed")
    return read


def confirm(file: DeviceFile) -> None:
    """Remember that its user lets exactly this content be run. Call it only after they were asked.

    Raises:
        UserError: the settings cannot be read or written.
    """
    settings = read_settings("devices")
    others = {key: name for key, name in settings.trusted.items() if key != file.sha256}
    write_settings(replace(settings, trusted={**others, file.sha256: str(file.path)}), "devices")


def confirmed_files() -> tuple[Path, ...]:
    """Files that were confirmed and are still there, latest first.

    Raises:
        UserError: the settings are damaged.
    """
    names = dict.fromkeys(reversed([*read_settings("devices").trusted.values()]))
    return tuple(path for path in map(Path, names) if path.is_file())


def remembered_files() -> tuple[tuple[Path, State | Literal["missing"]], ...]:
    """Every file of which a content was ever confirmed, latest first: as it reads now.

    Raises:
        UserError: the settings are damaged.
    """
    names = dict.fromkeys(reversed([*read_settings("devices").trusted.values()]))
    paths = [Path(name) for name in names]
    return tuple((path, device_file(path).state if path.is_file() else "missing") for path in paths)


def forget(path: Path) -> None:
    """Forget that this file was ever confirmed, whether it is still there or not.

    Raises:
        UserError: it never was, or the settings cannot be read or written.
    """
    if not forget_file(str(path.resolve()), "devices"):
        raise UserError(f"{path} was never confirmed as a device of your own; there is nothing to forget.")


def forget_all() -> None:
    """Forget every device of one's own."""
    write_settings(OwnSettings(), "devices")


def own_device(path: Path, rate_hz: float) -> Device:
    """The device of a file, not yet open.

    Args:
        path: of the Python file. rate_hz: cycles a second that the rig file gives.

    Raises:
        UserError: the file cannot be read or run, holds no device or several, or it runs at another rate.
    """
    kinds = [one for one in _classes(path) if all(callable(getattr(one, call, None)) for call in CALLS)]
    if len(kinds) != 1:
        found = ", ".join(one.__name__ for one in kinds) or "none"
        raise UserError(
            f"{path} should hold one class with {', '.join(CALLS)}, name and rate_hz; it holds {found}."
        )
    try:
        with redirect_stdout(sys.stderr):
            device = kinds[0]()
    except (Exception, SystemExit) as error:  # whatever the file does
        raise UserError(f"{kinds[0].__name__} of {path} cannot be made: {_said(error)}.") from None
    if not isinstance(device, Device):
        raise UserError(f"{kinds[0].__name__} of {path} has no name or no rate_hz; add both.")
    if abs(device.rate_hz - rate_hz) > 1e-6 * rate_hz:
        raise UserError(
            f"{path} runs at {device.rate_hz:g} Hz and the rig file says {rate_hz:g} Hz; "
            "set rate_hz in its section [daq]."
        )
    return device


def _classes(path: Path) -> list[type]:
    """Classes that the file itself defines. It is run as it reads now, past what Python may have compiled."""
    name = f"fingerlab_own_device_{path.stem}"
    module = ModuleType(name)
    module.__file__ = str(path)
    content = _content(path)
    sys.modules[name] = module  # dataclasses and pickle look there
    try:
        # What the file prints must not get between a command's results.
        with redirect_stdout(sys.stderr):
            exec(compile(content, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:  # whatever the file does
        raise UserError(f"{path} cannot be run: {_said(error)}.") from None
    return [one for _, one in inspect.getmembers(module, inspect.isclass) if one.__module__ == name]


def _content(path: Path) -> bytes:
    if not path.is_file():
        raise UserError(f"{path} does not exist; name the Python file of a device.")
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(
            f"{path} cannot be read ({error.strerror}); name the Python file of a device."
        ) from None


def _said(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split()).rstrip(".: ")

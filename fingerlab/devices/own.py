"""A device of one's own: a Python file with one class that keeps to the protocol.

The file is run where it is named, and nowhere else: it moves a motor, and should have been read by whoever
names it. Who writes ``own:FILE`` in a command has named it; where it is chosen from a list, as in the window,
:func:`confirm` remembers that its user let exactly this content be run.
"""

from __future__ import annotations

import inspect
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Literal

from fingerlab.core import trust
from fingerlab.core.errors import UserError
from fingerlab.core.trust import (
    OwnSettings,
    OwnSource,
    State,
    confirmed_names,
    forget_file,
    read_settings,
    run_source,
    said,
    with_state,
    write_settings,
)
from fingerlab.devices.protocol import Device

CALLS = ("open", "start", "set_enable", "exchange", "make_safe", "close")
"""What a class needs beside ``name`` and ``rate_hz`` to be taken for a device."""


def device_file(path: Path) -> OwnSource:
    """A file that is chosen; it is read, not run.

    Raises:
        UserError: it cannot be read, or the settings are damaged.
    """
    return with_state(_source(path), read_settings("devices"))


def confirm(file: OwnSource) -> None:
    """Remember that its user lets exactly this content be run. Call it only after they were asked.

    Raises:
        UserError: the settings cannot be read or written.
    """
    trust.confirm(file, "devices")


def confirmed_files() -> tuple[Path, ...]:
    """Files that were confirmed and are still there, latest first.

    Raises:
        UserError: the settings are damaged.
    """
    return tuple(path for path in map(Path, confirmed_names("devices")) if path.is_file())


def remembered_files() -> tuple[tuple[Path, State | Literal["missing"]], ...]:
    """Every file of which a content was ever confirmed, latest first: as it reads now.

    Raises:
        UserError: the settings are damaged.
    """
    paths = [Path(name) for name in confirmed_names("devices")]
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
        raise UserError(f"{kinds[0].__name__} of {path} cannot be made: {said(error)}.") from None
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
    source = _source(path)
    try:
        module = run_source(source, name)
    except (Exception, SystemExit) as error:  # whatever the file does
        raise UserError(f"{path} cannot be run: {said(error)}.") from None
    return [one for _, one in inspect.getmembers(module, inspect.isclass) if one.__module__ == name]


def _source(path: Path) -> OwnSource:
    if not path.is_file():
        raise UserError(f"{path} does not exist; name the Python file of a device.")
    try:
        return OwnSource(str(path.resolve()), path.read_bytes())
    except OSError as error:
        raise UserError(
            f"{path} cannot be read ({error.strerror}); name the Python file of a device."
        ) from None

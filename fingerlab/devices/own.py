"""A device of one's own: a Python file with one class that keeps to the protocol.

The file is run where it is named, and nowhere else: it moves a motor, and should have been read by whoever
names it.
"""

from __future__ import annotations

import importlib.util
import inspect
import sys
from pathlib import Path

from fingerlab.devices.protocol import Device
from fingerlab.errors import UserError

CALLS = ("open", "start", "set_enable", "exchange", "make_safe", "close")
"""What a class needs beside ``name`` and ``rate_hz`` to be taken for a device."""


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
        device = kinds[0]()
    except Exception as error:  # whatever the file does
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
    """Classes that the file itself defines."""
    if not path.is_file():
        raise UserError(f"{path} does not exist; give own: with the Python file of a device.")
    name = f"fingerlab_own_device_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise UserError(f"{path} is no Python file; give own: with the Python file of a device.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look there
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever the file does
        raise UserError(f"{path} cannot be run: {_said(error)}.") from None
    return [one for _, one in inspect.getmembers(module, inspect.isclass) if one.__module__ == name]


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {str(error).rstrip('.')}"

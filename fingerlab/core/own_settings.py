"""What is remembered of a user's own files: where effects are, and which contents they have confirmed."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from fingerlab.core.errors import UserError
from fingerlab.core.files import whole_file
from fingerlab.core.reading import structured

SETTINGS_VARIABLE = "FINGERLAB_SETTINGS_DIR"
"""Environment variable that puts the settings into another folder than the system's usual one."""

Kind = Literal["effects", "devices"]
"""What the files add. Who lets a file be run as one has not let it be run as the other."""


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
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return OwnSettings()
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path} cannot be read ({error}); {_REPAIR[kind]}.") from None
    try:
        stored = structured(_Stored, json.loads(text))
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

"""What became of the last check of a bench, kept for its rig file: without it the motor gets little current.

A check holds for what it was made of: the bench, its wiring and its limits. Whoever changes one of them in
the rig file checks again. Slopes and zeros of the sensors are left out: a calibration changes them, and
judges them by the data sheet.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from fingerlab.acquisition.check_rig.look import CheckProtocol, finite, write_protocol
from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import read_object
from fingerlab.devices.choosing import OWN, DeviceChoice
from fingerlab.rig.constants import Rig
from fingerlab.rig.daq import SOURCES, plain_section

UNCHECKED_SHARE = 0.1
"""Of the rig's limit of the current; so much a bench gets that nobody has checked."""

CALIBRATED = ("load_cell", "mcp", "pip")


@dataclass(frozen=True)
class KeptCheck:
    """The last check of a bench as it is wired now.

    Attributes:
        date: ISO 8601; empty where there was none. open: steps that failed or were left out.
        changed: it was checked, and its wiring or limits were changed since.
    """

    date: str = ""
    open: tuple[str, ...] = ()
    changed: bool = False

    @property
    def confirmed(self) -> bool:
        """Whether everything was, and nothing was changed since."""
        return bool(self.date) and not self.open and not self.changed

    @property
    def words(self) -> str:
        """A few words: when it was checked, and with what result."""
        if not self.date:
            return "never checked"
        on = f"checked on {datetime.fromisoformat(self.date):%Y-%m-%d at %H:%M}"
        if self.changed:
            return f"{on}, and wiring or limits of the rig file were changed since"
        if self.open:
            return f"{on}, not confirmed: {', '.join(self.open)}"
        return f"{on}, all confirmed"

    def current_share(self) -> float:
        """Of the rig's limit of the current that the loop may send."""
        return 1.0 if self.confirmed else UNCHECKED_SHARE

    def sentence(self, rig: Rig) -> str:
        """What holds for the motor; for an operator."""
        words = f"{self.words[:1].upper()}{self.words[1:]}"
        if self.confirmed:
            return f"{words}."
        amps = UNCHECKED_SHARE * rig.limits.current
        return (
            f"{words}: the current stays below {amps:.2g} A, a tenth of its limit, until a check confirms it."
        )


def checks_folder(rig_file: Path | None = None) -> Path:
    """Where checks are kept: beside a rig file, else among the user's data."""
    if rig_file is not None:
        return rig_file.with_name(f"{rig_file.stem}-checks")
    from platformdirs import user_data_path

    return user_data_path("FingerLab", appauthor=False) / "rigs" / "default" / "checks"


def bench_key(choice: DeviceChoice) -> str:
    """Which bench it is, beside what the wiring says (card and server): the content of an own device.

    Raises:
        UserError: the file of the own device cannot be read.
    """
    if choice.kind != OWN or choice.file is None:
        return choice.kind
    from fingerlab.devices.choosing import device_file

    return f"{OWN}:{device_file(choice.file).sha256}"


def keep(protocol: CheckProtocol, folder: Path) -> Path:
    """Write the protocol under a name of its own.

    Raises:
        UserError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder} cannot be made ({error.strerror}); the check is not kept.") from None
    stem = protocol.date[:19].replace(":", "")
    path, number = folder / f"{stem}.json", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.json"
    write_protocol(protocol, path)
    return path


def last_check(rig: Rig, bench: str, folder: Path) -> KeptCheck:
    """The newest check of this bench as it is wired; of another wiring where there is none of this one.

    Args:
        bench: by :func:`bench_key`. A file that cannot be read counts as none.
    """
    wiring, other = _wiring(plain_section(rig.daq), plain_section(rig.limits)), KeptCheck()
    for path in sorted(folder.glob("*.json"), reverse=True):
        try:
            data = read_object(read_text(path, "the protocol of a check"), str(path), "see check-rig")
            if data.get("kind") != "check-rig" or data.get("bench") != bench:
                continue
            same = _wiring(data["daq"], data["limits"]) == wiring
            steps = tuple(str(step["id"]) for step in data["steps"] if step["state"] in ("failed", "skipped"))
            date = str(data["date"])
            datetime.fromisoformat(date)
        except (UserError, KeyError, TypeError, ValueError):
            continue
        if same:
            return KeptCheck(date, steps)
        if not other.date:
            other = KeptCheck(date, changed=True)
    return other


def _wiring(daq: Any, limits: Any) -> Any:
    """Wiring and limits as a check holds for them."""
    plain = {name: value for name, value in dict(daq).items() if name != SOURCES}
    for name in CALIBRATED:
        plain[name] = {
            key: value for key, value in dict(plain[name]).items() if key not in ("gain", "offset")
        }
    kept = {name: value for name, value in dict(limits).items() if name != SOURCES}
    return json.loads(json.dumps(finite({"daq": plain, "limits": kept})))

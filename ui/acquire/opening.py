"""Opening a bench: what the user chose, and how it comes to run. No Qt; not for the GUI thread."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fingerlab.acquisition.bench import Bench
    from fingerlab.devices.protocol import Found
    from fingerlab.rig import Rig


@dataclass(frozen=True)
class Wanted:
    """What the user chose.

    Attributes:
        device: as :func:`fingerlab.devices.choosing.choose_device` takes it. rig_file: None for the default.
        effect: of the simulated rig: empty for none, ``hidden``, or an effect's id. seed: which bench.
        preset: of the simulated rig.
    """

    device: str
    rig_file: Path | None = None
    effect: str = ""
    seed: int = 0
    preset: str = "practice"


@dataclass(frozen=True)
class OpenBench:
    """A bench that runs: its rig, and what a simulated one says of itself for the session file."""

    bench: Bench
    rig: Rig
    attributes: Mapping[str, Any] = field(default_factory=dict)


OpenCall = Callable[[Wanted], OpenBench]


def open_bench(wanted: Wanted) -> OpenBench:
    """Build the device in processes of its own.

    Raises:
        UserError: there is no such device, or it does not answer.
    """
    from fingerlab.acquisition.process_bench import ProcessBench
    from fingerlab.acquisition.requests import LoopSettings
    from fingerlab.acquisition.safety import Limits
    from fingerlab.acquisition.units import BenchUnits
    from fingerlab.devices.choosing import CARD, choose_device
    from fingerlab.devices.simulated import Simulation
    from fingerlab.rig_file import load_rig
    from fingerlab.twin.effects import parse_effects

    rig = load_rig(wanted.rig_file) if wanted.rig_file is not None else None
    hidden = wanted.effect == "hidden"
    effects = parse_effects(() if hidden or not wanted.effect else (wanted.effect,))
    simulation = Simulation(wanted.preset, wanted.seed, effects, hidden)
    choice = choose_device(wanted.device, rig, simulation)
    attributes: dict[str, Any] = {}
    if choice.kind == CARD:
        assert choice.rig is not None
        known: Rig = choice.rig
        rate = known.daq.rate_hz
    else:  # built here, too, to be asked what it is; the loop's process builds its own
        device = choice.build()
        known = device.rig  # type: ignore[attr-defined]
        rate = device.rate_hz
        attributes = dict(getattr(device, "session_attributes", {}))
    settings = LoopSettings(BenchUnits.from_rig(known), Limits.from_rig(known))
    return OpenBench(ProcessBench(choice, settings, rescue_folder(), rate), known, attributes)


def rescue_folder() -> Path:
    """Where a recording is saved whose own folder has vanished."""
    from platformdirs import user_data_path

    return user_data_path("FingerLab", appauthor=False) / "rescued"


def find_devices(rig_file: Path | None) -> tuple[Found, ...]:
    """What can be used, with the sentence to show.

    Raises:
        UserError: the rig file cannot be read.
    """
    from fingerlab.devices.detect import detect
    from fingerlab.rig_file import load_rig

    return detect(load_rig(rig_file) if rig_file is not None else None)


def effect_choices() -> tuple[tuple[str, str], ...]:
    """Id and title of every effect that the simulated rig can have."""
    from fingerlab.report.diagnosis_words import effect_title
    from fingerlab.twin.effect_table import EFFECTS

    return tuple(sorted(((name, effect_title(name)) for name in EFFECTS), key=lambda pair: pair[1]))

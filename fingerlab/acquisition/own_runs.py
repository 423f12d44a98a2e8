"""A user's own protocol: n runs of one motion on air, then as many that press the load cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fingerlab.acquisition.protocol import RunPlan


@dataclass(frozen=True)
class OwnRun:
    """One run of it; see :class:`fingerlab.acquisition.protocol.RunPlan`."""

    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    load_torque: float = 0.0
    attributes: Mapping[str, Any] = field(default_factory=dict)


def in_contact(run: RunPlan, amplitude_deg: float) -> OwnRun:
    """The same motion in contact: with the flexion cable, about where the load cell is pressed."""
    press = {name: value for name, value in run.trajectory.items() if name != "offset_deg"}
    return OwnRun("contact", "flexion", {**press, "amplitude_deg": amplitude_deg}, 0.0, run.attributes)


def own_runs(
    motion: Mapping[str, Any], count: int, on_air: bool, contact_amplitude_deg: float | None
) -> list[OwnRun]:
    """``count`` runs of a motion on air, or in contact, or both.

    Args:
        contact_amplitude_deg: of the runs in contact; None for none.
    """
    air = OwnRun("on_air", "extension", motion)
    runs = [air] * count if on_air else []
    return (
        runs if contact_amplitude_deg is None else [*runs, *[in_contact(air, contact_amplitude_deg)] * count]
    )

"""A model with the effect of a simulated bench, found quickly: what a force trial is tried with."""

from __future__ import annotations

from pathlib import Path

from fingerlab.models.file import write_model
from fingerlab.prediction import fit_extended, model_of_extended
from fingerlab.sessions import open_session
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import load_preset, single_run
from fingerlab.twin.session import write_session

EFFECT, SEED = "spring_hardening=x1.5", 4


def model_with_effect(folder: Path) -> Path:
    """Of a short session of that bench, fitted with its effect; written into the folder."""
    air = {"kind": "multisine", "frequency_hz": 0.7, "duration_s": 10.0}
    plans = [
        single_run({**air, "amplitude_deg": 12.0, "offset_deg": 22.0}, "on_air", "extension"),
        single_run({**air, "amplitude_deg": 8.0, "offset_deg": 14.0}, "on_air", "flexion"),
    ]
    for frequency in (0.5, 0.8):
        motion = {"kind": "sine", "amplitude_deg": 1.6, "frequency_hz": frequency, "duration_s": 10.0}
        plans.append(single_run(motion, "contact"))
    session, kept = folder / "S.h5", folder / "M.json"
    write_session(session, load_preset("practice"), "t", plans, parse_effects((EFFECT,)), SEED)
    write_model(model_of_extended(fit_extended([open_session(session)], ["spring_hardening"])), kept)
    return kept

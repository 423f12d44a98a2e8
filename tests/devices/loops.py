"""A position loop around any device: that of the twin."""

from __future__ import annotations

from typing import Any

import numpy as np

from fingerlab.devices.protocol import Sample
from fingerlab.twin.integrate import position_loop
from fingerlab.twin.plant import STATE
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.recording import PERIOD, prepare_bench, seeded_truth

SINE = {"kind": "sine", "amplitude_deg": 14, "frequency_hz": 1, "offset_deg": 22, "duration_s": 5}


def follow(device: Any, reference: np.ndarray) -> list[Sample]:
    """The twin's position loop around the device, from its encoder counts to its volts."""
    preset = load_preset()
    truth, _ = seeded_truth(preset, 0)
    plan = RunPlan("on_air", "extension", SINE)
    control = prepare_bench(preset, truth, plan, {}, np.random.default_rng(0)).control
    memory, volts, samples = np.zeros(1, STATE)[0], 0.0, []
    daq = device.rig.daq
    for wanted in reference:
        samples.append(device.exchange(volts))
        # The middle of the count, for the loop rounds down again.
        angle = daq.encoder.quantity(samples[-1].raw[4]) + 0.5 * control["count"]
        volts = daq.command.volts(position_loop(control, memory, angle, wanted, PERIOD))
    return samples

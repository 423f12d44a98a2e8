"""The second bench as a device of one's own: ``record --device own:tests/hidden/engine/own_device.py``.

It keeps to ``docs/own-device.md``: raw volts and counts out, a set value in. The flexion cable is on it, and
the load cell below the fingertip. What is wrong with it stands in the environment variable
``FINGERLAB_ENGINE``, as JSON ``{"effects": {id: strength or null}, "seed": 1}``: a class that is made without
arguments can be told no other way. ``rig_text`` is its rig file.
"""

from __future__ import annotations

import json
import math
import os
from importlib import resources

import mujoco
import numpy as np

from fingerlab.devices.protocol import DeviceFault, Sample
from fingerlab.rig.file import default_rig
from tests.hidden.engine.bench import NOMINAL
from tests.hidden.engine.model import build, settle
from tests.hidden.engine.sensors import (
    ANGLE_NOISE,
    ANGLE_STEP,
    CURRENT_NOISE,
    CURRENT_STEP,
    FORCE_NOISE,
    FORCE_STEP,
)
from tests.hidden.engine.session import POSTURE, bench_with
from tests.hidden.engine.simulate import COUNT, SUBSTEPS, hang_cable, updates_of

VARIABLE = "FINGERLAB_ENGINE"
RATE_HZ = 1000.0


def rig_text() -> str:
    """What the bench knows of itself, wired and limited like the default rig; TOML."""
    tolerance = NOMINAL["tolerance"]
    lines = []
    for section in ("finger", "motor"):
        lines.append(f"[{section}]")
        for name, value in NOMINAL[section].items():
            own = f", tolerance = {tolerance[name]}" if name in tolerance else ""
            lines.append(f"{name} = {{ value = {value}{own} }}")
    default = resources.files("fingerlab.resources").joinpath("rigs/default.toml").read_text(encoding="utf-8")
    return "\n".join(lines) + "\n\n" + default[default.index("[daq]") :]


class EngineBench:
    """The finger with its flexion cable, above the load cell, behind a current amplifier."""

    name = "second engine"
    rate_hz = RATE_HZ

    def __init__(self) -> None:
        told = json.loads(os.environ.get(VARIABLE, '{"effects": {}, "seed": 0}'))
        self._daq = default_rig().daq
        self._bench = bench_with(told["effects"], told["seed"])[0]
        self._rng = np.random.default_rng([told["seed"], 99])
        self._built = build(self._bench, "flexion", True, POSTURE, 1.0)
        self._data = settle(self._built)
        hang_cable(self._bench, self._built, self._data, "flexion")
        self._data.qfrc_applied[self._built.motor] = -self._bench.motor_bias
        self._updates = updates_of(self._bench, self._built, 1.0)
        self._late: list[tuple[float, float, float]] = []
        self._gain = self._bench.motor["torque_constant"] * self._bench.motor["gear_ratio"]
        self._volts, self._index = 0.0, -1
        self._enabled = self._running = False

    def open(self) -> None:
        self.make_safe()

    def start(self) -> None:
        if self._running:
            raise DeviceFault("The second engine runs already; stop it before it is started again.")
        self._running, self._index = True, -1

    def set_enable(self, on: bool) -> None:
        self._enabled = on

    def exchange(self, command_volts: float) -> Sample:
        if not self._running:
            raise DeviceFault("The second engine has not been started.")
        current = float(self._daq.command.current(self._volts)) if self._enabled else 0.0
        self._turn(current)
        self._volts = command_volts
        self._index += 1
        return Sample(self._index, self._raw(current))

    def make_safe(self) -> bool:
        self._volts, self._enabled, self._running = 0.0, False, False
        return True

    def close(self) -> None:
        self.make_safe()

    def _turn(self, current: float) -> None:
        """One cycle with the current held."""
        model, data = self._built.model, self._data
        data.ctrl[self._built.drive] = self._gain * current
        if not self._updates:
            mujoco.mj_step(model, data, nstep=SUBSTEPS)
            return
        for _ in range(SUBSTEPS):
            for update in self._updates:
                update(data)
            mujoco.mj_step(model, data)

    def _raw(self, current: float) -> tuple[float, ...]:
        bench, built, data = self._bench, self._built, self._data
        plate, speed = float(data.qpos[built.plate]), float(data.qvel[built.plate])
        force = -bench.cell_stiffness * plate - bench.cell_damping * speed
        size, phase = bench.sensor_harmonic
        true = [float(data.qpos[place]) for place in (built.mcp, built.pip)]
        mcp, pip = (angle + size * math.sin(2.0 * angle + phase) for angle in true)
        self._late.append((force * bench.force_gain, mcp, pip))
        force, mcp, pip = self._delayed()
        seen = (
            self._convert(force, FORCE_NOISE, FORCE_STEP),
            self._convert(mcp, ANGLE_NOISE, ANGLE_STEP),
            self._convert(pip, ANGLE_NOISE, ANGLE_STEP),
            self._convert(current, CURRENT_NOISE, CURRENT_STEP),
        )
        volts = [
            min(max(float(line.volts(value)), line.low), line.high)
            for line, value in zip(self._daq.inputs, seen, strict=True)
        ]
        return (*volts, float(math.floor(float(data.qpos[built.motor]) / COUNT + 0.5)))

    def _delayed(self) -> tuple[float, ...]:
        """What force and angles were ``delay`` ago, between two cycles as a line."""
        back = min(self._bench.delay * RATE_HZ, len(self._late) - 1.0)
        whole, part = int(back), back - int(back)
        newer, older = self._late[-1 - whole], self._late[-1 - min(whole + 1, len(self._late) - 1)]
        if len(self._late) > 1000:
            del self._late[:500]
        return tuple((1.0 - part) * a + part * b for a, b in zip(newer, older, strict=True))

    def _convert(self, value: float, noise: float, step: float) -> float:
        return round((value + noise * float(self._rng.standard_normal())) / step) * step

"""The simulated bench one sample at a time, for a control loop outside of it: state is kept between calls.

The physics are those of a simulated recording, step for step; noise is drawn from the same
distributions but in another order, since nobody knows how long a stream will be.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.twin.bench import draw_truth
from fingerlab.twin.effects import Effects
from fingerlab.twin.integrate import run_sample
from fingerlab.twin.layout import BRISTLES, OUTPUTS
from fingerlab.twin.plant import Sensors, Truth
from fingerlab.twin.preset import Preset
from fingerlab.twin.protocols import RATE_HZ, RunPlan
from fingerlab.twin.recording import STEPS, prepare_bench, state_at_rest

PERIOD = 1.0 / RATE_HZ
WARM_UP = 15.0
"""s, time constant of a drifting sensor: half a run of the thesis, as in a simulated recording."""

_NOISE_BLOCK = 4096
_THETA, _CURRENT, _Q1, _Q2, _FORCE = (OUTPUTS.index(n) for n in ("theta", "current", "q1", "q2", "force"))


class BenchStream:
    """A bench with one cable on (or none), driven by a current, seen through its sensors.

    Args:
        rng: of this set-up's friction and of the noise. steps: internal steps a sample.
        counts_per_turn: of the encoder at the output; that of the preset where it is not given.

    Attributes:
        now: what really is, in the order of ``layout.OUTPUTS``, SI.
    """

    def __init__(
        self,
        preset: Preset,
        truth: Truth,
        plan: RunPlan,
        effects: Effects,
        rng: np.random.Generator,
        steps: int = STEPS,
        counts_per_turn: float | None = None,
    ) -> None:
        self._bench = prepare_bench(preset, truth, plan, effects, rng)
        self._state = state_at_rest(self._bench, plan.phase == "contact")
        self._plant = np.array([self._bench.plant], dtype=self._bench.plant.dtype)
        self._memory = np.zeros(BRISTLES)
        self._steps = steps
        self._limit = float(self._bench.control["current_limit"])
        self._rng = rng
        self._sensors = self._bench.sensors
        self._bridged = self._sensors.bridge_offset != 0.0 or self._sensors.bridge_mismatch != 0.0
        self._count = 2.0 * math.pi / (counts_per_turn or preset.numbers["control"]["counts"])
        self._noise: list[list[float]] = []
        self._noise_at = 0
        self._past: deque[tuple[float, float, float]] = deque(
            maxlen=2 + math.ceil(self._sensors.delay / PERIOD)
        )
        self._samples = 0
        self.has_finger = plan.phase != "motor_bench"
        self._row = np.zeros(len(OUTPUTS))
        self._row[_Q1], self._row[_Q2] = self._state["q1"][0], self._state["q2"][0]
        self.now: list[float] = self._row.tolist()
        self._remember()

    def advance(self, current: float) -> None:
        """One sample further at a constant current command (A), within what the amplifier can give.

        Raises:
            UserError: the bench ran away.
        """
        limit = self._limit
        command = -limit if current < -limit else limit if current > limit else current
        run_sample(
            self._plant,
            self._bench.friction,
            self._memory,
            self._state,
            command,
            self._steps,
            PERIOD,
            self._row,
        )
        self.now = self._row.tolist()  # plain numbers are several times quicker than numpy's scalars
        if not math.isfinite(self.now[_THETA]):
            raise UserError(
                "The simulated bench ran away; choose effect strengths within the range of the catalogue."
            )
        self._samples += 1
        self._remember()

    def hang(self, load_torque: float) -> None:
        """From now on this known load (N m) is on the motor of a motor bench."""
        self._plant["load_torque"] = load_torque

    def seen(self) -> tuple[float, float, float, float, float]:
        """What the sensors make of it: force (N), MCP, PIP (rad), current (A), encoder (whole counts).

        Force and angles are NaN where there is no finger. Each call has noise of its own.
        """
        noise = self._next_noise()
        sensors, now = self._sensors, self.now
        current = _quantised(now[_CURRENT] + sensors.current_noise * noise[0], sensors.current_step)
        counts = float(math.floor(now[_THETA] / self._count))
        if not self.has_finger:
            return math.nan, math.nan, math.nan, current, counts
        force, q1, q2 = self._late()
        if self._bridged:
            q1, q2 = bridge_angle(q1, sensors), bridge_angle(q2, sensors)
        if sensors.drift:
            q1 += self._drift()
        mcp, pip = q1 + sensors.angle_noise * noise[1], q2 + sensors.angle_noise * noise[2]
        return (
            _quantised(sensors.force_gain * force + sensors.force_noise * noise[3], sensors.force_step),
            _quantised(mcp, sensors.angle_step),
            _quantised(pip, sensors.angle_step),
            current,
            counts,
        )

    def _remember(self) -> None:
        self._past.appendleft((self.now[_FORCE], self.now[_Q1], self.now[_Q2]))

    def _late(self) -> tuple[float, float, float]:
        """Force and angles as they were ``delay`` ago; before the start they were at rest."""
        if self._sensors.delay == 0.0:
            return self._past[0]
        back = self._sensors.delay / PERIOD
        whole = int(back)
        newer = self._past[min(whole, len(self._past) - 1)]
        older = self._past[min(whole + 1, len(self._past) - 1)]
        share = back - whole
        a, b, c = (n + share * (o - n) for n, o in zip(newer, older, strict=True))
        return a, b, c

    def _drift(self) -> float:
        warm = 1.0 - math.exp(-self._samples * PERIOD / WARM_UP)
        return self._sensors.drift * warm / (1.0 - math.exp(-2.0))

    def _next_noise(self) -> list[float]:
        if self._noise_at == len(self._noise):
            self._noise = self._rng.standard_normal((_NOISE_BLOCK, 4)).tolist()
            self._noise_at = 0
        self._noise_at += 1
        return self._noise[self._noise_at - 1]


def bridge_angle(angle: float, sensors: Sensors) -> float:
    """What two magnetoresistive bridges at 45 degrees make of a shaft angle (rad); zeroed at zero."""
    if sensors.bridge_offset == 0.0 and sensors.bridge_mismatch == 0.0:
        return angle
    wide = 1.0 + sensors.bridge_mismatch
    seen = math.atan2(math.sin(2.0 * angle) + sensors.bridge_offset, wide * math.cos(2.0 * angle))
    return 0.5 * seen - 0.5 * math.atan2(sensors.bridge_offset, wide)


def seeded_truth(preset: Preset, seed: int) -> tuple[Truth, Any]:
    """The bench that ``seed`` draws (the same as in a simulated session) and seeds for what follows."""
    seeds = np.random.SeedSequence(seed)
    return draw_truth(preset, np.random.default_rng(seeds.spawn(1)[0])), seeds


def _quantised(value: float, step: float) -> float:
    return round(value / step) * step if step > 0.0 else value

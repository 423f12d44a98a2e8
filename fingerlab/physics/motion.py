"""Signals that the terms of an equation are made from, all of one run, and the fingertip on the load cell.

A tip that presses stands where the load cell's face is. Its height from the measured angles can only change
because the face leans, because tip and load cell give way, or because the angles are wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fingerlab.physics import nominal
from fingerlab.physics.friction_states import rubbing_forces, with_grid
from fingerlab.rig.file import Finger, Intervention, Motor
from fingerlab.sessions.model import Array

GLIMPSE_SAMPLES = 300

STRONGEST = 16
"""So many lines of the spectrum over the motor's angle are told; assumed."""
HIGHEST_ORDER = 300.0
"""Beyond, the encoder's own error repeats; assumed: three times a motor of 14 poles and 12 slots."""
LINE_WIDTHS = 2.0
"""A line under Hann's window reaches so many periods within the travel to either side."""
WHOLE_SHARES = (1 / 4, 1 / 16)
"""Share of a line's width by which a whole order, and a quarter of one, may be off its peak: noise and other
lines move it; assumed."""
LEAST_PERIODS = 2.0
"""A line is told by so many periods within the travel at least."""
BINS_A_TURN = 2048
STANDSTILL = 0.05
"""Share of the usual speed below which friction is on its way from one sign to the other; assumed."""


@dataclass(frozen=True)
class Motion:
    """High-bandwidth signals of one stretch of one run; arrays have shape (n,) and SI units.

    The joint channels are None in a motor-bench run; ``force`` is zero where nothing is touched.
    """

    phase: str
    cable_sign: int
    sample_rate_hz: float
    time: Array
    position: Array  # motor, rad at the pulley
    velocity: Array
    acceleration: Array
    torque: Array  # motor, N m at the gearbox output
    motor: Motor
    finger: Finger | None = None
    joints: nominal.JointMotion | None = None
    force: Array | None = None
    knocks: Array | None = None  # what the knocks of a tip that lands add to the force; None: none are seen
    load: Array | None = None
    revolute: bool = True  # no axis along a line, told as an arc, nor one that moves by far less than a turn
    lead: int = 0  # samples at the start that only set the memory of what has one; no equation counts there
    slip_mean_from: int = 0  # sample from which on the share of rubbing that is left to a lean is taken
    position_step: float = 0.0  # of the motor's encoder, rad
    inertia_spread: float = 0.0  # of the rotor's inertia, one standard deviation, kg m^2
    intervention: Intervention | None = None  # what is known to be otherwise; None: no run of these has one
    change: tuple[int, int] = (
        0,
        0,
    )  # number of that change among those of the sessions (0: none), and theirs
    repairs: Mapping[tuple[str, str], int] = field(default_factory=dict)  # samples, by how and channel
    drive_sign: int = 0  # of a motor alone: -1 where its torque, as it was logged, clearly helps the motion
    repaired_at: Array = field(default_factory=lambda: np.zeros(0))  # s, where spikes were, in any channel
    _memory: dict[object, Array] = field(default_factory=dict, repr=False, compare=False)

    def remember(self, key: object, make: Callable[[], Array]) -> Array:
        """``make()``, computed once for each ``key``: several effects share the same state of friction."""
        if key not in self._memory:
            self._memory[key] = make()
        return self._memory[key]

    def remember_each(
        self, wanted: object, keys: Sequence[object], make: Callable[[], Iterable[Array]]
    ) -> Array:
        """What ``make()`` gives for the key ``wanted``; it makes the arrays of all ``keys`` at once."""
        if wanted not in self._memory:
            self._memory.update(zip(keys, make(), strict=True))
        return self._memory[wanted]

    def head(self) -> Motion:
        """The first samples: enough to see which terms there are."""

        def cut(value: object) -> Any:
            return value[:GLIMPSE_SAMPLES] if isinstance(value, np.ndarray) else value

        own = {name: cut(value) for name, value in vars(self).items() if name != "_memory"}
        if self.joints is not None:
            own["joints"] = nominal.JointMotion(*(cut(value) for value in vars(self.joints).values()))
        return Motion(**own)

    @property
    def radius(self) -> float:
        """Pulley radius, m; 1 for a motor bench without a pulley, where tension reads as torque."""
        return self.motor.pulley_radius if self.finger is not None and self.motor.pulley_radius else 1.0

    @property
    def tension(self) -> Array:
        """Motor torque over pulley radius, N; inertia not subtracted."""
        return self.remember("tension", lambda: self.cable_torque / self.radius)

    @property
    def cable_torque(self) -> Array:
        """Motor torque less what a known load beside the cable takes of it, N m; inertia not subtracted."""
        load = 0.0 if self.intervention is None else self.intervention.load_torque
        return self.torque - load if load else self.torque

    @property
    def known_torques(self) -> tuple[Array, Array]:
        """What a known change adds to the left-hand sides of MCP and PIP, N m; with arms as usual."""
        finger, q = self.finger_and_joints
        change = self.intervention or Intervention()
        body = added_body(finger, change)
        return (
            nominal.mcp_torque(body, q).total + change.mcp_stiffness * q.mcp,
            nominal.pip_torque(body, q).total + change.pip_stiffness * q.pip,
        )

    @property
    def weights(self) -> tuple[float, float]:
        """First moments of weight, N m: of the proximal link with what it carries; of the distal."""
        finger, _ = self.finger_and_joints
        near = (
            (finger.proximal_mass + 2.0 * finger.distal_mass) * finger.gravity * finger.proximal_half_length
        )
        far = finger.distal_mass * finger.gravity * finger.distal_half_length
        if self.intervention is None or not self.intervention.added_mass:
            return near, far
        body = added_body(finger, self.intervention)
        weight = body.distal_mass * body.gravity
        return near + 2.0 * weight * body.proximal_half_length, far + weight * body.distal_half_length

    @property
    def inertial_pull(self) -> Array:
        """Tension that one kg m^2 on the motor side takes to follow its motion, N."""
        return self.remember("inertial pull", lambda: self.acceleration / self.radius)

    @property
    def contact_torques(self) -> tuple[Array, Array]:
        """What the force on the tip adds to the balance of MCP and PIP, N m; zero where there is none."""
        force = np.zeros_like(self.time) if self.force is None else self.force
        mcp, pip = self.contact_levers
        return (
            self.remember("contact mcp", lambda: force * mcp),
            self.remember("contact pip", lambda: force * pip),
        )

    @property
    def knock_torques(self) -> tuple[Array, Array]:
        """What of the contact torques the knocks of a tip that lands are, N m; zero where there are none."""
        if self.knocks is None:
            return nothing(len(self.time)), nothing(len(self.time))  # two, as they are where there are any
        knocks = self.knocks
        mcp, pip = self.contact_levers
        return (
            self.remember("knock mcp", lambda: knocks * mcp),
            self.remember("knock pip", lambda: knocks * pip),
        )

    @property
    def contact_levers(self) -> tuple[Array, Array]:
        """Levers of the force on the tip about MCP and PIP, m."""
        finger, q = self.finger_and_joints
        return (
            self.remember("lever mcp", lambda: nominal.contact_lever_mcp(finger, q.mcp, q.pip)),
            self.remember("lever pip", lambda: nominal.contact_lever_pip(finger, q.mcp, q.pip)),
        )

    def tip_slip_force(self, stiffness: float, grid: Sequence[float] = ()) -> Array:
        """Friction (N, for a coefficient of 1) of a tip whose sideways force follows the normal one.

        It takes on ``stiffness`` N a newton of normal force until it slides; ``grid`` are others that will be
        asked for. The share of the force that it has on the mean is left to a lean.
        """
        stiffnesses = with_grid(stiffness, grid)
        keys = [("slipping", one) for one in stiffnesses]
        return self.remember_each(keys[0], keys, lambda: self._slipping(stiffnesses))

    def _slipping(self, stiffnesses: Sequence[float]) -> Array:
        if self.force is None:
            return np.zeros((len(stiffnesses), len(self.time)))
        normal = np.maximum(self.force, 0.0)
        values = rubbing_forces(normal, normal, stiffnesses)
        counted = slice(self.slip_mean_from, None)
        shares = values[:, counted].sum(axis=1) / max(float(normal[counted].sum()), 1e-3)
        return np.asarray(values - shares[:, None] * normal)

    def pressed_by(self, force: Array, rubbing: Motion) -> Motion:
        """The same with another force at the tip, N, (n,), that rubs as in ``rubbing``.

        How a tip rubs depends on how its force came to be; at a force that is assumed to stay it would not.
        """
        kept: dict[object, Array] = {
            key: v for key, v in rubbing._memory.items() if isinstance(key, tuple) and key[0] == "slipping"
        }
        return replace(self, phase="contact", force=force, _memory=kept)

    def with_motor_late(self, delay: float) -> Motion:
        """The same with the motor's channels later by ``delay`` (s); at the start they stand still."""
        then = self.time - delay
        late = {
            name: np.interp(then, self.time, getattr(self, name))
            for name in ("position", "velocity", "acceleration", "torque")
        }
        return replace(self, **late, _memory={})

    @property
    def finger_and_joints(self) -> tuple[Finger, nominal.JointMotion]:
        """The finger's constants and motion; only finger runs have terms that ask for them."""
        if self.finger is None or self.joints is None:
            raise ValueError("a motor-bench run has no joints")
        return self.finger, self.joints


def added_body(finger: Finger, change: Intervention) -> Finger:
    """A finger that consists of the known mass of a change and nothing else."""
    none = dict.fromkeys(
        ("proximal_mass", "proximal_inertia", "distal_inertia", "mcp_stiffness", "pip_stiffness"), 0.0
    )
    return replace(finger, **none, distal_mass=change.added_mass, distal_half_length=change.added_mass_at)


def nothing(length: int) -> Array:
    """Zeros, shape (length,), read-only and without memory of their own; another array at every call."""
    return np.ndarray((length,), np.float64, bytes(8), 0, (0,))


def strongest_lines(motions: Sequence[Motion]) -> dict[float, float]:
    """At which orders the torque of a motor alone repeats most with its angle, strongest first.

    Of what a smooth law of angle, speed, acceleration and load leaves.

    Returns:
        Share of the strongest line's power by order, in periods a turn, told in quarters where it is at one.
    """
    travel = float(np.median([np.ptp(one.position) for one in motions]))
    size = 1 << math.ceil(math.log2(4.0 * BINS_A_TURN * max(travel / (2.0 * math.pi), 1.0)))
    power = np.zeros(size // 2 + 1)
    for one in motions:
        power += np.abs(np.fft.rfft(_over_angle(one)[:size], size)) ** 2
    orders = np.arange(len(power)) * BINS_A_TURN / size
    width = 2.0 * math.pi / max(travel, 1e-9)  # of a line, in orders
    turns = all(one.revolute for one in motions)
    places = np.flatnonzero((orders >= LEAST_PERIODS * width) & (orders <= HIGHEST_ORDER))
    found: dict[float, float] = {}
    for place in places[np.argsort(-power[places], kind="stable")]:
        order = _order_of(power, int(place), BINS_A_TURN / size, width if turns else 0.0)
        if (
            power[place] > 0
            and order > 0
            and all(abs(order - other) > LINE_WIDTHS * width for other in found)
        ):
            found[order] = float(power[place])
        if len(found) == STRONGEST:
            break
    strongest = next(iter(found.values()), 1.0)
    return {order: each / strongest for order, each in found.items()}


def _order_of(power: Array, place: int, step: float, width: float) -> float:
    """Order of the line at a ``place`` of a spectrum over the angle, whose places are ``step`` orders apart.

    By the parabola through the logarithms of its power and its neighbours'. Teeth and poles are whole
    numbers: one that is as near as a line can be told, by its ``width`` in orders, is the order, or a quarter
    that is nearer still; of a motor that turns by less than once, whose lines are wider than an order, the
    nearest quarter. An axis that has no turn gives no width.
    """
    shift = 0.0
    if 0 < place < len(power) - 1 and power[place - 1 : place + 2].min() > 0.0:
        before, here, after = np.log(power[place - 1 : place + 2])
        bend = before - 2.0 * here + after
        shift = float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < 0.0 else 0.0
    order = (place + shift) * step
    if width >= 1.0:
        return round(4.0 * order) / 4.0
    for parts, share in zip((1.0, 4.0), WHOLE_SHARES, strict=True):
        told = round(parts * order) / parts
        if abs(order - told) < share * width:
            return told
    return round(order, 4)


def _over_angle(motion: Motion) -> Array:
    """Mean torque by bins of the angle, less a smooth law of angle, speed, acceleration and load."""
    inner = slice(motion.lead, None)
    angle, torque = motion.position[inner], motion.torque[inner]
    across = (angle - angle.mean()) / max(float(np.ptp(angle)), 1e-12)
    speed = motion.velocity[inner] / max(float(np.sqrt(np.mean(motion.velocity[inner] ** 2))), 1e-12)
    load = np.zeros_like(angle) if motion.load is None else motion.load[inner]
    smooth = np.stack(
        (
            np.ones_like(angle), across, across**2, across**3, speed, np.tanh(speed / STANDSTILL),
            motion.acceleration[inner], load,
        ),
        axis=1,
    )  # fmt: skip
    scale = np.maximum(np.abs(smooth).max(axis=0), 1e-300)
    rest = torque - smooth / scale @ np.linalg.lstsq(smooth / scale, torque, rcond=None)[0]
    number = ((angle - angle.min()) * (BINS_A_TURN / (2.0 * math.pi))).astype(int)
    count = np.bincount(number)
    return np.asarray(np.bincount(number, rest) / np.maximum(count, 1) * np.hanning(len(count)))


TOUCHING_FORCE_N = 0.2
"""Force from which the tip is held by the load cell, N; assumed: ten times its noise."""


def tip_depth(motion: Motion) -> Array:
    """How far the tip is below the MCP joint, against the direction of the force on it, m, shape (n,)."""
    f, q = motion.finger_and_joints
    return np.asarray(
        2.0 * f.proximal_half_length * np.sin(q.mcp - f.wrist_angle)
        + 2.0 * f.distal_half_length * np.sin(q.mcp + q.pip - f.wrist_angle)
    )


def tip_reach(motion: Motion) -> Array:
    """How far the tip is in front of the MCP joint, along the load cell's face, m, shape (n,)."""
    return motion.remember("tip reach", lambda: _reach(motion))


def _reach(motion: Motion) -> Array:
    f, q = motion.finger_and_joints
    return np.asarray(
        2.0 * f.proximal_half_length * np.cos(f.wrist_angle - q.mcp)
        + 2.0 * f.distal_half_length * np.cos(q.mcp + q.pip - f.wrist_angle)
    )


def dragged_tip(motion: Motion, stiffness: float, grid: Sequence[float] = ()) -> Array:
    """Friction (N, for a coefficient of 1) of a tip that takes on ``stiffness`` (N/m) on its travel, (n,).

    ``grid`` are others that will be asked for.
    """
    held = np.zeros_like(motion.time) if motion.force is None else np.maximum(motion.force, 0.0)
    stiffnesses = with_grid(stiffness, grid)
    keys = [("dragged", one) for one in stiffnesses]
    return motion.remember_each(keys[0], keys, lambda: rubbing_forces(tip_reach(motion), held, stiffnesses))


def pressed(motion: Motion) -> Array:
    """1 where the tip presses on the load cell, 0 where it does not touch it, shape (n,)."""
    if motion.force is None:
        return np.zeros_like(motion.time)
    return np.asarray(np.clip(motion.force / TOUCHING_FORCE_N, 0.0, 1.0))


def while_pressed(motion: Motion, values: Array) -> Array:
    """Values less their mean over the stretch while the tip presses; 0 where it does not, shape (n,).

    Where the load cell's face stands is not known, and may be another place in each run.
    """
    if motion.force is None:
        return nothing(len(values))
    share = motion.remember("pressed", lambda: pressed(motion))
    counted = motion.remember("pressed, counted", lambda: share[motion.lead :] ** 2)
    mean = float(counted @ values[motion.lead :]) / max(float(counted.sum()), 1e-12)
    return np.asarray(share * (values - mean))

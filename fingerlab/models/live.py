"""The present model beside the measurement while the motor runs: torque and force from the joint angles.

The PIP balance (3.17) with the cable and, in contact, the load cell (3.18) is solved once for the motor
torque and once for the force. Angles are differentiated by a local parabola through ``2 h + 1`` samples
(Savitzky and Golay 1964) whose middle is ``h`` samples old: nothing is shifted in time, but the model is
known :attr:`LiveModel.delay_s` later than the measurement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.models.file import SavedModel
from fingerlab.physics.nominal import JointMotion, contact_lever_pip, pip_torque, tension
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import CABLE_SIGN, Array

HALF_WINDOW_S = 0.04
"""h: a parabola follows 3 Hz to within 10 % in acceleration and takes the sensors' noise down (assumed)."""

MOVING = 0.05
"""rad/s; slower, the PIP joint keeps the direction of its last motion (assumed)."""

FIT_S = 20.0
ERROR_S = 3.0
"""Time constants of the running fit and of the error number, s (assumed)."""

FEWEST = 500
"""Moving samples before a running fit says anything: half a second at 1 kHz (assumed)."""

NAN = float("nan")


@dataclass(frozen=True)
class Balance:
    """PIP moment arm b (m) and loss L (N m) by the direction of motion: LHS2 = s b T + L2 - lever F."""

    arm_flexing: float
    loss_flexing: float
    arm_extending: float
    loss_extending: float


@dataclass(frozen=True)
class Measured:
    """Consecutive samples, each shape (n,): rad, rad, rad, N m, N; NaN where there is none."""

    mcp: Array
    pip: Array
    motor: Array
    torque: Array
    force: Array

    def joined(self, later: Measured) -> Measured:
        """Two stretches, one after the other."""
        return Measured(*(np.concatenate(pair) for pair in zip(self.columns, later.columns, strict=True)))

    def part(self, start: int, stop: int | None = None) -> Measured:
        """Samples ``start`` to ``stop``."""
        return Measured(*(column[start:stop] for column in self.columns))

    @property
    def columns(self) -> tuple[Array, Array, Array, Array, Array]:
        """All columns in their order."""
        return self.mcp, self.pip, self.motor, self.torque, self.force


@dataclass(frozen=True)
class Modelled:
    """Motor torque (N m) and endpoint force (N, contact only), shape (n,); NaN where there is no model."""

    torque: Array
    force: Array


def balance_of(model: SavedModel, cable: str, where: str = "the model file") -> Balance:
    """The PIP balance of a model that ``fit`` wrote; the other cable's where this one has none.

    Raises:
        UserError: the model holds no moment arm of the PIP joint.
    """
    for name in (cable, *(other for other in CABLE_SIGN if other != cable)):
        arms = {}
        for region in ("flexion", "extension", "whole"):
            key = f"{name}/pip/{region}"
            arm, loss = (model.parameters.get(f"{key}/{end}") for end in ("moment_arm", "friction_loss"))
            if arm is not None and loss is not None:
                arms[region] = arm.value, loss.value
        if arms:
            spare = next(iter(arms.values()))
            flexing = arms.get("flexion", arms.get("whole", spare))
            extending = arms.get("extension", arms.get("whole", spare))
            return Balance(*flexing, *extending)
    raise UserError(
        f"{where} holds no moment arm of the PIP joint; take a model that 'fingerlab fit' wrote for a "
        "session with runs on air."
    )


class LiveModel:
    """Fed with every sample once, in order.

    Args:
        rig: the finger's and the motor's constants.
        phase, cable: what is on the bench; a model exists for on_air and contact.
        balance: from a model file; None fits one arm and one loss to the last seconds of motion, so that
            what the nominal equations cannot follow stays as the residual.

    Raises:
        UserError: the rig has no finger or no pulley radius.
    """

    def __init__(self, rig: Rig, rate_hz: float, phase: str, cable: str, balance: Balance | None) -> None:
        if rig.finger is None or rig.motor.pulley_radius is None:
            raise UserError("The rig names no finger or no pulley radius; there is nothing to model.")
        self._finger, self._motor, self._radius = rig.finger, rig.motor, rig.motor.pulley_radius
        self._contact = phase == "contact"
        self._sign = CABLE_SIGN.get(cable, 0) if phase in ("on_air", "contact") else 0
        self._given = balance
        self._rate = rate_hz
        self.delay = round(HALF_WINDOW_S * rate_hz)
        self._smooth, self._speed, self._acceleration = _parabola(self.delay, rate_hz)
        self._kept: Measured | None = None
        self._direction = 1.0
        self._sums = np.zeros((2, 2))
        self._right = np.zeros(2)
        self._seen = 0.0
        self._squares = {"torque": (0.0, 0.0), "force": (0.0, 0.0)}

    @property
    def delay_s(self) -> float:
        """How much later than the measurement the model is known, s."""
        return self.delay / self._rate

    @property
    def balance(self) -> Balance | None:
        """What is used now; None while the running fit has seen too little motion."""
        if self._given is not None:
            return self._given
        if self._seen < FEWEST:
            return None
        arm, loss = np.linalg.lstsq(self._sums, self._right, rcond=1e-9)[0]
        return Balance(float(arm), float(loss), float(arm), float(loss))

    def error(self, what: str) -> float:
        """RMS of measured less modelled ``torque`` (N m) or ``force`` (N) over the last seconds; or NaN."""
        squares, weight = self._squares[what]
        return math.sqrt(squares / weight) if weight > 0.5 * self._rate else NAN

    def forget(self) -> None:
        """The samples to come do not follow on those before."""
        self._kept = None

    def extend(self, new: Measured) -> Modelled:
        """Take samples; returns as many modelled ones, ``delay`` samples older than the given."""
        count = len(new.mcp)
        whole = new if self._kept is None else self._kept.joined(new)
        width = 2 * self.delay
        self._kept = whole.part(max(len(whole.mcp) - width, 0))
        inside = len(whole.mcp) - width
        if inside <= 0 or not self._sign:
            return Modelled(np.full(count, NAN), np.full(count, NAN))
        modelled = self._solve(whole, whole.part(self.delay, len(whole.mcp) - self.delay))
        lead = np.full(count - inside, NAN)  # nothing can be said before the first window is full
        return Modelled(np.concatenate((lead, modelled.torque)), np.concatenate((lead, modelled.force)))

    def _solve(self, whole: Measured, middle: Measured) -> Modelled:
        motion = JointMotion(
            *(np.convolve(angle, self._smooth, "valid") for angle in (whole.mcp, whole.pip)),
            *(np.convolve(angle, self._speed, "valid") for angle in (whole.mcp, whole.pip)),
            *(np.convolve(angle, self._acceleration, "valid") for angle in (whole.mcp, whole.pip)),
        )
        spin = np.convolve(whole.motor, self._acceleration, "valid")
        lhs = pip_torque(self._finger, motion).total
        lever = contact_lever_pip(self._finger, motion.mcp, motion.pip)
        pull = tension(self._motor, middle.torque, spin)
        pressing = lever * middle.force if self._contact else np.zeros_like(lhs)
        flexing = self._flexing(motion.pip_velocity)
        if self._given is None:
            self._learn(motion.pip_velocity, pull, lhs + pressing)
        balance = self.balance
        if balance is None:
            empty = np.full_like(lhs, NAN)
            return Modelled(empty, empty)
        arm = self._sign * np.where(flexing, balance.arm_flexing, balance.arm_extending)
        loss = np.where(flexing, balance.loss_flexing, balance.loss_extending)
        with np.errstate(divide="ignore", invalid="ignore"):
            needed = (lhs + pressing - loss) / arm
            force = np.where(lever > 0, (arm * pull + loss - lhs) / lever, NAN)
        torque = self._radius * needed + (self._motor.inertia or 0.0) * spin
        torque[~np.isfinite(torque)] = NAN
        if not self._contact:
            force = np.full_like(lhs, NAN)
        self._judge("torque", middle.torque - torque)
        self._judge("force", middle.force - force)
        return Modelled(torque, force)

    def _flexing(self, speed: Array) -> Array:
        """Direction of the last motion at each sample, True for flexion."""
        sign = np.where(np.abs(speed) > MOVING, np.sign(speed), 0.0)
        sign = np.concatenate(([self._direction], sign))
        last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign)), 0))
        sign = sign[last]
        self._direction = float(sign[-1])
        return np.asarray(sign[1:] > 0)

    def _learn(self, speed: Array, pull: Array, left: Array) -> None:
        use = (np.abs(speed) > MOVING) & np.isfinite(pull) & np.isfinite(left)
        keep = math.exp(-len(speed) / (FIT_S * self._rate))
        columns = np.vstack((self._sign * pull[use], np.ones(int(use.sum()))))
        self._sums = keep * self._sums + columns @ columns.T
        self._right = keep * self._right + columns @ left[use]
        self._seen = keep * self._seen + float(use.sum())

    def _judge(self, what: str, residual: Array) -> None:
        good = residual[np.isfinite(residual)]
        keep = math.exp(-len(residual) / (ERROR_S * self._rate))
        squares, weight = self._squares[what]
        self._squares[what] = keep * squares + float(good @ good), keep * weight + len(good)


def _parabola(half: int, rate_hz: float) -> tuple[Array, Array, Array]:
    """Kernels for ``np.convolve``: value, first and second derivative of the local parabola's middle."""
    offsets = np.arange(-half, half + 1) / rate_hz
    rows = np.linalg.pinv(np.vander(offsets, 3, increasing=True))
    value, slope, bend = rows
    return value[::-1].copy(), slope[::-1].copy(), 2.0 * bend[::-1]

"""A simulated operator: places weights (or turns a joint) as asked, takes a moment, and may go wrong."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from fingerlab.calibration.wizard import Phase, Wizard

RATE = 20.0


class Operator:
    """Obeys a wizard; ``volts_at`` is the real sensor: mark -> volts.

    ``wrong`` maps the number of a step to the mark that is really placed, as often as it is asked for.
    ``drift`` adds volts in the second pass (hysteresis).
    """

    def __init__(
        self,
        wizard: Wizard,
        volts_at: Callable[[float], float],
        wrong: Mapping[int, float] | None = None,
        second: float = 0.0,
        noise: float = 0.001,
    ) -> None:
        self.wizard, self.volts_at = wizard, volts_at
        self.wrong, self.second, self.noise = dict(wrong or {}), second, noise
        self.random = np.random.default_rng(1)
        self.samples = 0
        self._seen: tuple[int, float] | None = None
        self._placed_at = -1e9

    def level(self) -> float:
        """What the sensor gives now, without noise, V."""
        move = self.wizard.move
        if move is not None:
            mark = self.wrong.get(self.wizard.number, move.mark)
            if (self.wizard.number, mark) != self._seen:
                self._seen = (self.wizard.number, mark)
                self._placed_at = self.samples / RATE
        assert self._seen is not None
        number, mark = self._seen
        late = number >= len(self.wizard.plan.moves) / 2
        return self.volts_at(mark) + (self.second if late else 0.0)

    def sample(self) -> tuple[float, float]:
        """Time and volts of the next sample at 20 Hz; for a second after placing it swings."""
        level = self.level()
        time = self.samples / RATE
        since = time - self._placed_at
        swing = 0.3 * np.exp(-4 * since) * np.cos(20 * since) if since < 3 else 0.0
        self.samples += 1
        return time, level + swing + self.random.normal(0, self.noise)

    def work(self, until: Callable[[], bool] | None = None, patience: float = 1000.0) -> None:
        """Go on until all steps are captured, or ``until`` says so."""
        end = self.samples + patience * RATE
        done = until or (lambda: self.wizard.phase is Phase.DONE)
        while not done():
            assert self.samples < end, f"stuck in {self.wizard.phase} of step {self.wizard.number + 1}"
            time, volts = self.sample()
            self.wizard.feed(np.array([time]), np.array([volts]))


def thesis_load_cell(mark: float) -> float:
    """Volts of the load cell of thesis (2.1), F = 11.194 V - 5.317, with a mass in kg on it."""
    return (9.81 * mark + 5.317) / 11.194


def angle_sensor(mark: float) -> float:
    """Volts of a KMA210 at 5 V: 40 degrees a volt, here 0 degrees at 1.1 V."""
    return 1.1 + mark / 40.0

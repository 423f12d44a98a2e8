"""Blind trials: what is put into the bench, and which of them a sweep takes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations

import numpy as np

WEAKEST, STRONGEST = 0.6, 1.6
"""Strengths are drawn between these multiples of the simulated bench's default, evenly in their logarithm."""


@dataclass(frozen=True)
class Trial:
    """One blind trial.

    Attributes:
        source: ``twin`` or ``engine``. protocol: ``rich`` or ``thesis``; ``short`` or ``motor-bench`` of
            varied benches.
        effects: ids put into the bench. seed: of the bench, its noise and the strengths.
        left_out: effects taken out of the catalogue, so that nothing in it is right.
        proposed: whether the proposed experiment is recorded too, and diagnosed with the session.
        varied: whether the seed draws size, rate, runs, noise and dirt, too (``surroundings``).
    """

    source: str
    protocol: str
    effects: tuple[str, ...]
    seed: int
    left_out: tuple[str, ...] = ()
    proposed: bool = False
    varied: bool = False

    @property
    def key(self) -> str:
        return json.dumps(asdict(self), sort_keys=True)

    @property
    def strengths(self) -> list[float]:
        """Multiples of the default strength, one for each effect."""
        rng = np.random.default_rng([self.seed, len(self.effects), sum(map(ord, "".join(self.effects)))])
        return list(np.exp(rng.uniform(np.log(WEAKEST), np.log(STRONGEST), len(self.effects))))


def singles(
    source: str, protocol: str, ids: Sequence[str], seeds: Sequence[int], proposed: bool = False
) -> Iterator[Trial]:
    """One effect each; ``proposed``: the experiment that the diagnosis proposes follows."""
    for name in ids:
        for seed in seeds:
            yield Trial(source, protocol, (name,), seed, proposed=proposed)


def nothing(source: str, protocol: str, seeds: Sequence[int]) -> Iterator[Trial]:
    """Benches with nothing but noise and tolerances."""
    for seed in seeds:
        yield Trial(source, protocol, (), seed)


def pairs(source: str, ids: Sequence[str], count: int, seed: int) -> Iterator[Trial]:
    """Two effects each, drawn from all pairs."""
    every = list(combinations(ids, 2))
    chosen = np.random.default_rng(seed).permutation(len(every))[:count]
    for k in chosen:
        yield Trial(source, "rich", every[int(k)], seed + int(k))


def outside(source: str, ids: Sequence[str], seeds: Sequence[int]) -> Iterator[Trial]:
    """One effect each that the catalogue does not hold."""
    for name in ids:
        for seed in seeds:
            yield Trial(source, "rich", (name,), seed, left_out=(name,))

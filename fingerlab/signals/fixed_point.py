"""Fixed-point iterations of vectors that would go to and fro, or away, if each change were gone whole."""

from __future__ import annotations

import numpy as np

from fingerlab.sessions.model import Array

LEAST_FACTOR = 0.1
"""Of a change so much is gone at least (assumed: chance may look like a change that goes to and fro, and
would hold it where it stands)."""


def aitken_factor(before: tuple[float, Array] | None, change: Array) -> float:
    """Share of a fixed-point iteration's next change that is gone: Aitken's relaxation for vectors.

    Where changes go to and fro, one that goes about half as far ends it; where they go on, it is gone whole.
    Source: Irons and Tuck (1969), "A version of the Aitken accelerator for computer iteration".

    Args:
        before: factor and change of the iteration before; None: there was none. change: (n,).
    """
    if before is None:
        return 1.0
    factor, last = before
    turned = change - last
    size = float(turned @ turned)
    if size <= 0.0:
        return 1.0
    return float(np.clip(-factor * float(last @ turned) / size, LEAST_FACTOR, 1.0))

"""Where a recording has lost samples: nothing may be filtered, differentiated or folded across it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from fingerlab.sessions.format import RATE_TOLERANCE
from fingerlab.sessions.model import Array


def whole_pieces(time: Array, rate: float) -> list[slice]:
    """The pieces of a recording between its gaps, in order; one that is whole is one piece.

    Args:
        time: s, shape (n,). rate: samples a second.
    """
    gaps = np.flatnonzero(np.diff(time) > (1.0 + RATE_TOLERANCE) / rate) + 1
    return [slice(first, last) for first, last in pairwise([0, *gaps.tolist(), len(time)])]


def longest_piece(time: Array, rate: float) -> slice:
    """The longest piece of a recording without a gap, the first of such."""
    return max(whole_pieces(time, rate), key=lambda piece: piece.stop - piece.start)

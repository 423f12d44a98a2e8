"""Region recognition of thesis section 4.1: flexion, extension, and the standstills after each."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from fingerlab.sessions.model import Array

Region = Literal["flexion", "static_1", "extension", "static_2"]
Labels = np.ndarray[Any, np.dtype[np.int8]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]

REGIONS: tuple[Region, ...] = ("flexion", "static_1", "extension", "static_2")
"""A label is an index into this: static 1 follows flexion, static 2 follows extension."""

REGION_TITLES = {
    "flexion": "flexion",
    "static_1": "static 1",
    "extension": "extension",
    "static_2": "static 2",
    "whole": "whole run",
}

THRESHOLDS_PERCENT = (10, 20, 30)
"""Thresholds that the thesis tried, per cent of the joint's speed range (sections 4.1 and 4.2)."""

MINIMUM_SHARE = 0.02
"""Smallest share of a period that makes a region (assumed; the thesis says "a sufficient number")."""

_FLEXION, _STATIC_1, _EXTENSION, _STATIC_2 = range(4)


def speed_threshold(mean_speed: Array, percent: float) -> float:
    """Threshold in rad/s: ``percent`` of the range (maximum less minimum) of the average joint speed.

    Args:
        mean_speed: joint speed averaged over the periods, rad/s, shape (phases,).
    """
    return float(percent / 100.0 * np.ptp(mean_speed))


def recognise(mean_speed: Array, threshold: float) -> Labels:
    """Label each phase of the average period by its speed.

    Above ``+threshold`` is flexion, below ``-threshold`` extension; what lies between is static 1 where
    the last motion was flexion and static 2 where it was extension, round the period's end. A period
    that never leaves the thresholds (the contact runs under the on-air thresholds, thesis figure 4.7)
    follows no motion and is static 1 throughout.

    Args:
        mean_speed: rad/s, flexion positive, shape (phases,). threshold: rad/s, at least 0.

    Returns:
        Index into ``REGIONS``, shape (phases,).
    """
    labels = np.full(mean_speed.shape, _STATIC_1, dtype=np.int8)
    flexing, extending = mean_speed > threshold, mean_speed < -threshold
    labels[flexing], labels[extending] = _FLEXION, _EXTENSION
    moving = np.flatnonzero(flexing | extending)
    still = np.flatnonzero(~(flexing | extending))
    if len(moving) and len(still):
        # searchsorted gives the motion before each still phase; -1 wraps to the period's last motion.
        last = moving[np.searchsorted(moving, still) - 1]
        labels[still] = np.where(labels[last] == _FLEXION, _STATIC_1, _STATIC_2)
    return labels


def region_mask(labels: Labels, region: Region) -> Mask | None:
    """Phases of a region, shape (phases,); None where they are too few to make one (a missing bar)."""
    mask = labels == REGIONS.index(region)
    return mask if mask.sum() >= max(MINIMUM_SHARE * len(labels), 3) else None


def consecutive_mask(labels: Labels, region: Region) -> Mask | None:
    """The longest unbroken stretch of a region, round the period's end; None where it is too short.

    Section 4.2 needs consecutive samples, because a stretch of signal is searched for as a whole.
    """
    start, length = longest_stretch(labels == REGIONS.index(region))
    if length < max(MINIMUM_SHARE * len(labels), 3):
        return None
    mask = np.zeros(len(labels), dtype=bool)
    mask[np.arange(start, start + length) % len(labels)] = True
    return mask


def longest_stretch(mask: Mask) -> tuple[int, int]:
    """Start and length of the longest run of True on a circle; (0, 0) where there is none."""
    n = len(mask)
    if not mask.any():
        return 0, 0
    if mask.all():
        return 0, n
    origin = int(np.flatnonzero(~mask)[0])  # a False to start from, so that no stretch crosses the seam
    edges = np.diff(np.concatenate(([0], np.roll(mask, -origin).astype(np.int8), [0])))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    best = int(np.argmax(ends - begins))
    return (int(begins[best]) + origin) % n, int(ends[best] - begins[best])

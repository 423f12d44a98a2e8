"""What a residual can be plotted against to see an effect."""

from __future__ import annotations

COORDINATE_UNITS = {
    "time": "s",
    "joint speed": "rad/s",
    "joint angle": "rad",
    "joint acceleration": "rad/s^2",
    "difference of joint angles": "rad",
    "motor speed": "rad/s",
    "motor angle": "rad",
    "motor acceleration": "rad/s^2",
    "tension": "N",
    "tension times direction of travel": "N",
    "force": "N",
}
"""Fingerprint coordinate of an effect -> SI unit. A joint's is that of the joint whose equation is drawn."""

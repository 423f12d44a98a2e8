"""What can be asked of the thesis' analysis: method, delay and threshold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fingerlab.signals.regions import REGIONS, THRESHOLDS_PERCENT

Joint = Literal["mcp", "pip"]
Method = Literal["regions", "flexion-extension", "whole"]
Delay = Literal["none", "xcorr", "findsignal", "finddelay"]

JOINTS: tuple[Joint, ...] = ("mcp", "pip")
JOINT_TITLES = {"mcp": "MCP", "pip": "PIP"}


@dataclass(frozen=True)
class FitSpec:
    """One way to fit moment arms and losses.

    Attributes:
        method: ``regions`` (four, section 4.1), ``flexion-extension`` (section 4.2) or ``whole``
            (every usable sample of a run, whatever the finger does).
        delay: ``none``; ``xcorr``, cross-correlation with the period as a circle; ``findsignal``, least
            squared distance, one delay a region; ``finddelay``, cross-correlation as Matlab's function
            does it, which the thesis used and which is biased towards zero.
        threshold: per cent of the joint's speed range that parts motion from standstill.
    """

    method: Method = "regions"
    delay: Delay = "none"
    threshold: float = THRESHOLDS_PERCENT[0]

    @property
    def regions(self) -> tuple[str, ...]:
        """Ids of the regions that the method tells apart."""
        if self.method == "regions":
            return REGIONS
        return ("flexion", "extension") if self.method == "flexion-extension" else ("whole",)

    @property
    def title(self) -> str:
        """In words, for tables and figures."""
        if self.method == "whole":
            return "whole run" if self.delay == "none" else f"whole run, delay by {self.delay}"
        delay = "no delay" if self.delay == "none" else f"delay by {self.delay}"
        name = "four regions" if self.method == "regions" else "flexion and extension"
        return f"{name}, threshold {self.threshold:g} %, {delay}"


FOUR_REGIONS = FitSpec("regions", "none", 10)
"""Section 4.1."""

THESIS_DELAYS: tuple[Delay, ...] = ("none", "finddelay", "findsignal")
"""The three columns of figure 4.15."""


def thesis_specs() -> tuple[FitSpec, ...]:
    """Every fit that chapters 4 and 5 report."""
    grid = (FitSpec("flexion-extension", d, t) for d in THESIS_DELAYS for t in THRESHOLDS_PERCENT)
    return (FOUR_REGIONS, *grid)

"""Where a model misses, in words: the coordinate of a residual profile, its bins, and the worst of them."""

from __future__ import annotations

from collections.abc import Sequence

from fingerlab.core.text import ScreenUnit, decimals_for, fixed, largest_of, score_text, screen_unit
from fingerlab.diagnosis.answer.error_parts import Comparison
from fingerlab.diagnosis.answer.residual_profiles import COORDINATES, JOINTS, Profile
from fingerlab.report.diagnosis_words import PHASE_WORDS

CLEARLY = 1.2
"""From so many floors on a bin says that something is missed."""


def axis_title(found: Profile) -> str:
    """The coordinate with its joint: ``MCP joint speed``."""
    title = found.coordinate.title
    joint = JOINTS.get(found.equation, "pip").upper()
    return f"{joint} {title[:1].lower()}{title[1:]}" if "{}" in "".join(found.coordinate.sources) else title


def coordinates_of(comparisons: Sequence[Comparison], equation: str) -> tuple[str, ...]:
    """Ids of the coordinates over which a residual is drawn: a motor alone has no cable with a tension."""
    phases = {one.phase for one in comparisons if one.equation == equation}
    return tuple(name for name in COORDINATES if name != "tension" or phases != {"motor_bench"})


def coordinate_unit(found: Profile) -> ScreenUnit:
    """Unit of the coordinate on the screen."""
    return screen_unit(found.coordinate.unit, largest_of(map(float, found.edges)))


def residual_unit(found: Profile) -> ScreenUnit:
    """Unit of the residual on the screen."""
    return screen_unit(found.unit, largest_of([*map(float, found.rms), found.floor]))


def bin_words(found: Profile, bin_: int) -> str:
    """Which part of the coordinate a bin is: ``PIP joint speed −60 to −40 °/s``, ``run 011, in contact``."""
    if found.runs:
        session, run, phase = found.runs[bin_]
        several = len({one[0] for one in found.runs}) > 1
        return f"run {run}{f' of {session}' if several else ''}, {PHASE_WORDS.get(phase, phase)}"
    unit = coordinate_unit(found)
    width = (found.edges[1] - found.edges[0]) * unit.factor
    low, high = (
        fixed(float(edge) * unit.factor, decimals_for(0.1 * width)) for edge in found.edges[bin_ : bin_ + 2]
    )
    title = axis_title(found)
    lowered = title if title[:2].isupper() else f"{title[:1].lower()}{title[1:]}"
    return f"{lowered} {low} to {unit.after(high)}"


def miss_words(found: Profile, bin_: int) -> str:
    """By how much the model misses in a bin: ``2.5 mN m, 3.1 floors``."""
    rms = float(found.rms[bin_])
    if rms != rms:
        return "too few samples to say"
    unit = residual_unit(found)
    step = max(0.3 * found.floor, 0.005 * rms)  # half a per cent is told of what is far beyond the floor
    amount = unit.after(fixed(rms * unit.factor, decimals_for(step * unit.factor)))
    return f"{amount}, {score_text(rms / found.floor)} floors" if found.floor > 0 else amount


def worst_words(found: Profile) -> str:
    """The worst bin in a sentence, or that none stands out."""
    if found.rms[found.worst] <= CLEARLY * found.floor:
        return "Nowhere clearly beyond the floor."
    return f"Worst at {bin_words(found, found.worst)}: {miss_words(found, found.worst)}."

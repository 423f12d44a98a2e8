"""Units and numbers: one table of what they are in SI, and how a person reads a number in them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

RAD_IN_DEGREE = math.pi / 180.0
"""rad."""
INCH, KILOGRAM_FORCE, POUND_FORCE = 0.0254, 9.80665, 4.4482216152605
"""m, N and N, as they are defined."""

FACTORS: Mapping[str, Mapping[str, float]] = {
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": RAD_IN_DEGREE, "°": RAD_IN_DEGREE, "degrees": RAD_IN_DEGREE,
            "Grad": RAD_IN_DEGREE, "rev": 2 * math.pi, "turn": 2 * math.pi, "turns": 2 * math.pi},
    "rad/s": {"rad/s": 1.0, "deg/s": RAD_IN_DEGREE},
    "rad/V": {"rad/V": 1.0, "deg/V": RAD_IN_DEGREE},
    "A": {"A": 1.0, "mA": 1e-3},
    "A/V": {"A/V": 1.0, "mA/V": 1e-3},
    "V": {"V": 1.0, "v": 1.0, "volt": 1.0, "volts": 1.0, "mV": 1e-3},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": KILOGRAM_FORCE, "lbf": POUND_FORCE},
    "N m": {"N m": 1.0, "Nm": 1.0, "N·m": 1.0, "N*m": 1.0, "mNm": 1e-3, "mN m": 1e-3, "N mm": 1e-3,
            "Nmm": 1e-3, "N cm": 1e-2, "Ncm": 1e-2, "kN m": 1e3, "kNm": 1e3,
            **dict.fromkeys(("kgf cm", "kgfcm", "kgf·cm", "kgf*cm", "kg cm", "kgcm"), 1e-2 * KILOGRAM_FORCE)},
    "N m/A": {"N m/A": 1.0, "mN m/A": 1e-3},
    "N m/rad": {"N m/rad": 1.0, "mN m/rad": 1e-3, "N mm/rad": 1e-3, "N m/deg": 180.0 / math.pi},
    "kg": {"kg": 1.0, "g": 1e-3},
    "kg m^2": {"kg m^2": 1.0, "g cm^2": 1e-7, "g mm^2": 1e-9},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "in": INCH, "inch": INCH},
}  # fmt: skip
"""SI unit -> unit that a file of a person may hold -> factor to SI."""

_SPELLINGS = {"N m": {"Nm", "N.m", "N*m", "N·m"}, "rad": {"radian", "radians"}}


def factor(unit: str, si: str) -> float | None:
    """What values in ``unit`` are multiplied by to be in the SI unit ``si``; None where they cannot be."""
    return 1.0 if unit == si else FACTORS.get(si, {}).get(unit)


def same_unit(found: str, wanted: str) -> bool:
    """Whether two spellings mean the same unit (``Nm`` and ``N m``), without any conversion."""
    return found.strip() == wanted or found.strip() in _SPELLINGS.get(wanted, ())


@dataclass(frozen=True)
class ParameterEstimate:
    """A value with its 90 % interval ``low`` to ``high``, all in ``unit``."""

    value: float
    unit: str
    low: float
    high: float


def shown(text: str, most: int = 0) -> str:
    """Text of somebody else for a terminal or a line of a page: what steers one is written out.

    Control characters and those that turn the direction of writing around stand as ``\\x1b``, ``\\u202e``;
    line breaks and tabs stay.

    Args:
        most: letters after which it is cut; 0 for all of it.
    """
    if most and len(text) > most:
        text = text[: most - 1] + "…"
    return _STEERING.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)

SCREEN_UNITS = {"m": ("mm", 1e3), "N m": ("mN m", 1e3), "s": ("ms", 1e3)}
"""Units shown in place of SI ones, with the factor."""


def in_words(estimate: ParameterEstimate, with_unit: bool = True) -> str:
    """``value ± half interval unit`` in the unit of the screen, such as ``10.8 ± 0.4 mm``."""
    unit, factor = SCREEN_UNITS.get(estimate.unit, (estimate.unit, 1.0))
    if with_unit and estimate.unit == "N m":
        screen = screen_unit(estimate.unit, largest_of((estimate.value, estimate.low, estimate.high)))
        unit, factor = screen.symbol, screen.factor
    text = plus_minus(factor * estimate.value, factor * (estimate.high - estimate.low) / 2.0)
    return f"{text} {unit}" if with_unit and unit not in ("1", "") else text


def plus_minus(value: float, half: float) -> str:
    """``value ± half`` rounded to the first digit of ``half`` (two where it begins with 1).

    Without a finite ``half`` the value alone, to four digits; a dash where there is no value.
    """
    if not math.isfinite(value):
        return "–"
    if not math.isfinite(half) or half <= 0:
        return significant(value, 4)
    exponent = math.floor(math.log10(half))
    digits = -exponent + (1 if half / 10.0**exponent < 1.95 else 0)
    if (digits > 6 and abs(value) < 1e-3) or exponent > 5:
        power = max(math.floor(math.log10(max(abs(value), half))), exponent)
        mantissa = plus_minus(value / 10.0**power, half / 10.0**power)
        return f"({mantissa})·10^{power}"
    value = value if round(value, digits) else 0.0  # no "-0"
    return f"{round(value, digits):.{max(digits, 0)}f} ± {round(half, digits):.{max(digits, 0)}f}"


def significant(value: float, digits: int = 3) -> str:
    """A number to so many significant digits, ``34100`` for ``3.41e+04``; with an exponent from 1e5 on."""
    if not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(float(text)) < LEAST_EXPONENT else text


LEAST_EXPONENT = 1e5
"""Numbers from here on have an exponent."""


def amount(value: float, si: str, digits: int = 3) -> str:
    """A value in the SI unit ``si`` with the unit that its size asks for, ``34.1 N m`` or ``737 mN m``."""
    unit = screen_unit(si, abs(value))
    return unit.after(significant(value * unit.factor, digits))


def number(value: float, digits: int = 3) -> str:
    """A number with fixed decimals, a dash where there is none."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"


def mean_and_deviation(mean: float, deviation: float, digits: int = 3) -> str:
    """``mean ± deviation`` of single results with fixed decimals: a spread is no uncertainty of the mean."""
    if not math.isfinite(mean):
        return "–"
    return (
        f"{number(mean, digits)} ± {number(deviation, digits)}"
        if math.isfinite(deviation)
        else number(mean, digits)
    )


DEGREES = 180.0 / math.pi
"""Degrees in a radian."""
MINUS = "−"
LOPSIDED = 1.5
"""An interval whose sides differ by more than this factor is written out in place of a ±."""


@dataclass(frozen=True)
class ScreenUnit:
    """A unit on the page: its symbol, and what SI values are multiplied by."""

    symbol: str
    factor: float

    def label(self, quantity: str) -> str:
        """An axis label: quantity and unit."""
        return f"{quantity} ({self.symbol})" if self.symbol else quantity

    def after(self, number: str) -> str:
        """A number with the unit behind it; degrees stand close."""
        return number if not self.symbol else f"{number}{'' if self.symbol[0] == '°' else ' '}{self.symbol}"


DEGREE, DEGREE_A_SECOND = ScreenUnit("°", DEGREES), ScreenUnit("°/s", DEGREES)
NEWTON, MILLI_NEWTON_METRE = ScreenUnit("N", 1.0), ScreenUnit("mN m", 1e3)
AMPERE, VOLT = ScreenUnit("A", 1.0), ScreenUnit("V", 1.0)
MILLISECOND, UNITLESS = ScreenUnit("ms", 1e3), ScreenUnit("", 1.0)
"""What is always shown in the same unit, however large it is."""


def screen_unit(si: str, largest: float) -> ScreenUnit:
    """The unit in which values up to ``largest`` (in the SI unit ``si``) read well; an unknown one stays."""
    si = si.strip()
    if si in ("", "1"):
        return ScreenUnit("", 1.0)
    if si == "1/turn":
        return ScreenUnit("per turn", 1.0)
    if si == "m":
        return ScreenUnit("µm", 1e6) if 0 < largest < 2e-4 else ScreenUnit("mm", 1e3)
    if si in ("m/s", "m/s^2", "m/s^3") and 0 < largest < 1.0:
        return ScreenUnit("m" + _pretty(si), 1e3)
    if si.startswith(("m/N", "m s/N")):
        return ScreenUnit("µ" + _pretty(si), 1e6)
    if si == "rad" or si.startswith(("rad/", "rad ")):
        return ScreenUnit("°" + _pretty(si[3:]), DEGREES)
    if si == "deg" or si.startswith("deg/"):
        return ScreenUnit("°" + si[3:], 1.0)
    if si == "kg":
        return ScreenUnit("g", 1e3) if largest < 1.0 else ScreenUnit("kg", 1.0)
    if si == "kg m^2" and largest >= 1.0:
        return ScreenUnit("kg m²", 1.0)
    if si == "kg m^2":
        return ScreenUnit("g cm²", 1e7) if largest < 1e-3 else ScreenUnit("kg cm²", 1e4)
    if si == "s":
        return ScreenUnit("ms", 1e3) if largest < 1.0 else ScreenUnit("s", 1.0)
    if si.startswith("N m") and largest >= 1e4:
        return ScreenUnit("k" + _pretty(si), 1e-3)
    if si.startswith("N m") or (si.startswith("N") and 0 < largest < 0.1):
        return ScreenUnit("m" + _pretty(si), 1e3) if largest < 1.0 else ScreenUnit(_pretty(si), 1.0)
    return ScreenUnit(_pretty(si), 1.0)


def _pretty(si: str) -> str:
    return si.replace("^2", "²").replace("^3", "³").replace("*", " ")


LEVEL = 0.90
"""Share of all intervals that are told which hold the true value."""


def listed(words: Sequence[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else list(words))


def largest_of(values: Iterable[float]) -> float:
    """The largest finite magnitude; 0 where there is none."""
    return max((abs(v) for v in values if math.isfinite(v)), default=0.0)


def estimate_text(estimate: ParameterEstimate) -> str:
    """``4.8 ± 0.2 mN m``; a lopsided interval as ``0.08° (0.08 to 0.25)``; without one the value alone."""
    unit = screen_unit(estimate.unit, largest_of((estimate.value, estimate.low, estimate.high)))
    value, low, high = (v * unit.factor for v in (estimate.value, estimate.low, estimate.high))
    half = (high - low) / 2.0
    if not math.isfinite(half) or half <= 0:
        return unit.after(with_minus(significant(value, 4)))
    below, above = value - low, high - value
    if min(below, above) <= 0 or max(below, above) > LOPSIDED * min(below, above):
        digits = decimals_for(max(min(below, above), half / 4.0))
        return f"{unit.after(fixed(value, digits))} ({fixed(low, digits)} to {fixed(high, digits)})"
    return unit.after(with_minus(plus_minus(value, half)))


def decimals_for(uncertainty: float) -> int:
    """Decimals that an uncertainty allows: its first digit, two where the first is 1; 0 to 6."""
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return 3
    exponent = math.floor(math.log10(uncertainty))
    return min(max(0, -exponent + (1 if uncertainty / 10.0**exponent < 1.95 else 0)), 6)


def fixed(value: float, decimals: int) -> str:
    """A number with that many decimals and a real minus sign; never "−0", a dash where there is none."""
    if not math.isfinite(value):
        return "–"
    text = f"{value:.{decimals}f}"
    return with_minus(text if text.strip("-0.") else text.lstrip("-"))


def with_minus(text: str) -> str:
    """Hyphens in front of digits as minus signs; exponents too."""
    return text.replace("-", MINUS)


def grouped(count: int) -> str:
    """A count in groups of three digits, as ``1 234 567`` with narrow spaces."""
    return f"{count:,}".replace(",", "\u202f")


def score_text(score: float) -> str:
    """An error in multiples of the floor, or its square: ``1.03``, ``12.4``, ``340``, ``12300``."""
    if math.isfinite(score) and score >= 1000:
        return fixed(float(f"{score:.3g}"), 0)
    return fixed(score, score_decimals(score))


def score_decimals(score: float) -> int:
    """Decimals that an error in multiples of the floor is told to."""
    return 0 if score >= 100 else 1 if score >= 10 else 2


def percent(share: float, counted: bool = False) -> str:
    """A probability in per cent, never a false 0 or 100; a counted share may be all, or ``0.17 %``."""
    if counted:
        return f"{100 * share:.2g} %" if share < 0.01 else f"{round(100 * share)} %"
    if share > 0.995:
        return "> 99 %"
    if share < 0.005:
        return "< 1 %"
    return f"{round(100 * share)} %"


def r2_text(r2: float) -> str:
    """R2 with enough nines to tell good from very good: 0.874, 0.9942, 0.99996; rounded, but never to 1."""
    if not math.isfinite(r2):
        return "–"
    if r2 <= 0.9:
        return fixed(r2, 3) if r2 > -10 else "below −10"
    digits = min(max(3, math.ceil(-math.log10(max(1.0 - r2, 1e-12))) + 1), 6)
    rounded = fixed(r2, digits)
    if r2 < 1.0 and float(rounded) == 1.0:
        return fixed(math.floor(r2 * 10**digits) / 10**digits, digits)
    return rounded


_PRINTED = (
    (r"(?<![\w.)])-(?=\d)", "−"),
    (r"(?<=\d) deg\b", "°"),
    (r"\bdeg/s", "°/s"),
    (r"\bum\b", "µm"),
    (r"\^2\b", "²"),
    (r"\^3\b", "³"),
)


def printed(text: str) -> str:
    """A sentence of the terminal, whose letters are those of every keyboard, as page and window write it."""
    text = re.sub(r"(?<![\w.])\d(?:\.\d+)?e[+-]\d+", _plain, text)
    for pattern, by in _PRINTED:
        text = re.sub(pattern, by, text)
    return text


def _plain(number: re.Match[str]) -> str:
    """``1.3e+03`` as 1300, ``2e-05`` as 2 × 10⁻⁵."""
    digits, _, power = number[0].partition("e")
    if 0 <= int(power) <= MOST_ZEROS:
        return f"{float(number[0]):.0f}"
    return f"{digits} × 10{str(int(power)).translate(_RAISED)}"


MOST_ZEROS = 5
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


NO_BREAK = "\u00a0"
_UNIT = r"[kmcµnG]?(?:Hz|Nm|N|m|g|s|A|V|W|J|rad|°|K|min)[²³]?(?:/[A-Za-zµ°√]+[²³]?)*(?![\w])"
_AMOUNT = re.compile(
    r"(?:[<>≈] )?(?<![\w.])[−-]?\d[\d.,\u202f]*(?:°|%)?(?: ± [\d.]+)?"
    rf"(?: (?:%|×|floors?\b|{_UNIT}(?: {_UNIT})*))?"
)


def held_together(text: str) -> str:
    """The same words, in which no line ends within an amount, as between a number and its unit."""
    return _AMOUNT.sub(lambda amount: amount[0].replace(" ", NO_BREAK), text)


_NAMES = ("Coulomb", "Stribeck", "Dahl")


def in_sentence(title: str) -> str:
    """A title inside a sentence; one that starts with a name or an abbreviation keeps its capitals."""
    if title[:2].isupper() or title.startswith(_NAMES):
        return title
    return title[:1].lower() + title[1:]


MOST_NAMES = 12
"""Of runs that are told one by one."""


def run_names(names: Sequence[str], most: int = MOST_NAMES) -> str:
    """``run 001``, ``runs 001, 003``; of more than ``most``: ``14 runs, 001 to 014``."""
    if len(names) > most:
        return f"{len(names)} runs, {names[0]} to {names[-1]}"
    return f"run{'s' if len(names) > 1 else ''} {', '.join(names)}"

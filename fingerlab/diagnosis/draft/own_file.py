"""A drafted law as the file of an own effect: law, parameters and explanation, to be edited and let in."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from string import Template

from fingerlab.core.text import estimate_text
from fingerlab.diagnosis.draft.laws import DraftLaw, LawTerm
from fingerlab.diagnosis.draft.terms import PAIRED, PLACES
from fingerlab.diagnosis.settings import DRAFT_OWN_RANGE
from fingerlab.effects.own import own_name

IMPORTS = {
    "misread": "from fingerlab.effects.joints import misread",
    "sideways_terms": "from fingerlab.effects.joints import sideways_terms",
    "dahl_states": "from fingerlab.physics.friction_states import dahl_states",
    "first_order_lags": "from fingerlab.physics.friction_states import first_order_lags",
    "friction_state": "from fingerlab.physics.friction_states import friction_state",
    "way_while": "from fingerlab.physics.friction_states import way_while",
    "rubbing_forces": "from fingerlab.physics.friction_states import rubbing_forces",
}
"""What an expression of the library may need beyond numpy and the motion."""
NAMES = {
    "q.": "q = motion.joints",
    "tension": (
        "tension = motion.tension - (motion.motor.inertia or 0.0) * motion.inertial_pull  # less the rotor's"
    ),
    "force": "force = np.zeros_like(motion.time) if motion.force is None else motion.force",
    "load": "load = np.zeros_like(motion.time) if motion.load is None else motion.load",
}
"""Names in which expressions of the library are written, and the lines that make them."""


def own_effect_text(path: Path, law: DraftLaw) -> str:
    """The file of an own effect that is this law.

    Args:
        path: of its file; its name becomes the effect's id and title.

    Raises:
        UserError: no id can be made of the file's name.
    """
    name = own_name(path)
    lines = list(_law(law))
    text = "\n".join(lines)
    title = name.replace("_", " ").capitalize()
    first = law.terms[0]
    gains = list(_gains(law))
    template = files("fingerlab.resources").joinpath("effects", "draft.py.txt").read_text(encoding="utf-8")
    return Template(template).substitute(
        id=name,
        title=title,
        found="\n".join(_found(law)),
        imports="".join(f"{line}\n" for word, line in IMPORTS.items() if word in text),
        law=text,
        families=", ".join(f'"{one}"' for one in dict.fromkeys(PLACES[t.place].family for t in law.terms)),
        gains="\n".join(line for _, _, line in gains),
        coordinate=first.term.coordinate,
        row=PLACES[first.place].row.name,
        bench=any(t.place == "bench" for t in law.terms),
        grows=first.words.upper(),
        equation=law.equation,
        symbols="; ".join(f"C_{k}: coefficient of the {t.words}" for k, t in enumerate(law.terms, 1)) + ".",
        symbol_of=", ".join(f'"{gain}": "C_{k}"' for gain, k, _ in gains),
    )


def _found(law: DraftLaw) -> Iterator[str]:
    yield (
        f"On runs left out the error went from {law.score_before:.2f} to {law.score:.2f} floors"
        f"{' beside ' + ', '.join(law.beside) if law.beside else ''}; the best that the catalogue had left"
        f" {law.catalogue_score:.2f}."
    )
    yield law.cause
    for term in law.terms:
        yield f"- {term.sentence}"


def _gain(number: int, term: LawTerm, gain: str) -> str:
    """Name of a coefficient in the file."""
    joint = gain.rsplit("_", 1)[-1] if term.place in PAIRED else ""
    part = gain.split("_")[0].removeprefix("c")
    name = f"c{number}" + (f"_part{part}" if part else "")
    return f"{name}_{joint}" if joint else name


def _gains(law: DraftLaw) -> Iterator[tuple[str, int, str]]:
    """Name, number of its term and line of each coefficient."""
    for number, term in enumerate(law.terms, 1):
        flags = ", varies_between_runs=True" if term.term.varies else ""
        flags += ", holds_at_rest=True" if term.term.friction else ""
        words = dict(zip(term.term.gains, term.term.part_words, strict=True))
        for gain, estimate in term.coefficients.items():
            value = term.reduced[gain]  # ranges are those of a machine of the thesis' size
            low, high = sorted((0.0, DRAFT_OWN_RANGE * value))
            name, said = _gain(number, term, gain), f"coefficient of the {words[gain]}"
            yield (
                name,
                number,
                (
                    f'        "{name}": Gain(  # found: {estimate_text(estimate)}\n'
                    f'            unit="{estimate.unit}", low={low:.4g}, high={high:.4g},\n'
                    f"            typical={abs(value):.4g},\n"
                    f'            source="assumed", title="{said}"{flags},\n'
                    "        ),"
                ),
            )


def _law(law: DraftLaw) -> Iterator[str]:
    """The lines of ``columns``."""
    codes = [term.term.code(part) for term in law.terms for part in term.term.parts]
    bench = [t for t in law.terms if t.place == "bench"]
    together = " ".join(codes)

    def named(condition: bool, indent: str) -> Iterator[str]:
        for name, line in NAMES.items():
            if re.search(rf"(?<![\w.]){re.escape(name)}", together) and (name != "q.") == condition:
                yield f"{indent}{line}"

    yield from named(True, "    ")
    for number, term in enumerate(law.terms, 1):
        if term.place == "bench":
            yield from _values(number, term)
    alone = [line for t in bench for line in _terms(law, t, alone=True)]
    yield "    if motion.joints is None:  # a run of the motor alone"
    yield f"        return [{', '.join(alone)}]"
    yield from named(False, "    ")
    for number, term in enumerate(law.terms, 1):
        if term.place != "bench":
            yield from _values(number, term)
    yield "    return ["
    for term in law.terms:
        yield from (f"        {line}," for line in _terms(law, term))
    yield "    ]"


def _values(number: int, term: LawTerm) -> Iterator[str]:
    for k, part in enumerate(term.term.parts):
        yield f"    value_{number}{'abcd'[k]} = {term.term.code(part)}"


def _terms(law: DraftLaw, term: LawTerm, alone: bool = False) -> Iterator[str]:
    """What a term is in the equations, as expressions; ``alone``: in those of a motor alone."""
    number = law.terms.index(term) + 1
    for k, (part, gain) in enumerate(zip(term.term.parts, term.term.gains, strict=True)):
        name, value, place = _gain(number, term, gain), f"value_{number}{'abcd'[k]}", part.place or term.place
        if alone:
            yield f'Term(Row.BENCH, "{name}", {value})'
        elif place == "cable":
            yield f'Term(Row.CABLE, "{name}", {value})'
        elif place in ("motor", "bench"):  # behind a cable the motor's torque is a tension
            for row in ("MCP", "PIP"):
                yield f'Term(Row.{row}, "{name}", {value} / motion.radius)'
            yield f'Term(Row.CABLE, "{name}", {value} / motion.radius, "compliance")'
        elif place in PAIRED["sensors"]:
            yield f'*misread(motion, "{name}", "{place.removeprefix("sensor_")}", {value})'
        elif place == "tip":
            yield f'*sideways_terms(motion, "{name}", {value})'
        elif place == "cell":
            for joint, row in enumerate(("MCP", "PIP")):
                yield f'Term(Row.{row}, "{name}", {value} * motion.contact_levers[{joint}], "joint")'
        else:
            yield f'Term(Row.{PLACES[place].row.name}, "{name}", {value}, "joint")'

"""The search box: plain words, and words with a key in front such as ``phase:contact`` or ``-tag:bad``."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from fingerlab.core.errors import UserError
from fingerlab.library.facts import SessionFacts

HELP = (
    "Words must all occur in name, title, operator, phase, rig, tags, notes, flags or verdict. A minus in "
    "front excludes. Keys: phase:contact, cable:flexion, tag:good, flag:late, verdict:coulomb, "
    "operator:name, after:2026-05-01, before:2026-06, longer:60 and shorter:60 (seconds), is:clean, is:bad."
)


@dataclass(frozen=True)
class Entry:
    """A session with what is known of it besides its file: tags, notes and verdict in words."""

    facts: SessionFacts
    tags: tuple[str, ...] = ()
    notes: str = ""
    verdict: str = ""


Test = Callable[[Entry], bool]


def matches(query: str) -> Test:
    """The test that a query stands for; an empty one takes every session.

    Raises:
        UserError: a key or its value is not understood.
    """
    tests = [_negated(word) for word in _words(query)]
    return lambda entry: all(test(entry) for test in tests)


def _words(query: str) -> list[str]:
    try:
        return shlex.split(query.casefold().replace("\\", "\\\\"), posix=True)
    except ValueError:
        return query.casefold().replace('"', " ").split()  # a quotation that is still being typed


def _negated(word: str) -> Test:
    if word.startswith("-") and len(word) > 1:
        test = _test(word[1:])
        return lambda entry: not test(entry)
    return _test(word)


def _test(word: str) -> Test:
    key, colon, value = word.partition(":")
    if not colon or key not in (*_TEXTS, *_MEASURES, "is"):
        return lambda entry: any(word in text for text in _all_texts(entry))
    if key in _TEXTS:
        texts = _TEXTS[key]
        return lambda entry: any(value in text.casefold() for text in texts(entry))
    if key == "is":
        if value not in ("clean", "bad"):
            raise UserError(f"is:{value} is not understood; write is:clean or is:bad.")
        return lambda entry: bool(entry.facts.flags or entry.facts.problem) == (value == "bad")
    return _measure(key, value)


def _measure(key: str, value: str) -> Test:
    if key in ("longer", "shorter"):
        try:
            limit = float(value)
        except ValueError:
            raise UserError(f"{key}:{value} is not understood; write seconds, such as {key}:60.") from None
        if key == "longer":
            return lambda entry: entry.facts.seconds > limit
        return lambda entry: entry.facts.seconds < limit
    if not (value and value[0].isdigit()):
        raise UserError(f"{key}:{value} is not understood; write a date, such as {key}:2026-05-01.")
    # ISO 8601 text sorts as time does, and a part of a date stands for its beginning.
    if key == "after":
        return lambda entry: entry.facts.created[: len(value)].casefold() >= value
    return lambda entry: bool(entry.facts.created) and entry.facts.created[: len(value)].casefold() < value


def _all_texts(entry: Entry) -> Iterable[str]:
    facts = entry.facts
    texts = (facts.name, facts.title, facts.operator, facts.rig, facts.created, facts.problem, facts.notes)
    more = (entry.notes, entry.verdict, *facts.phases, *facts.cables, *facts.tags, *entry.tags, *facts.flags)
    return (text.casefold().replace("_", " ") for text in (*texts, *more))


_TEXTS: Mapping[str, Callable[[Entry], Iterable[str]]] = {
    "phase": lambda entry: (text for p in entry.facts.phases for text in (p, p.replace("_", " "))),
    "cable": lambda entry: entry.facts.cables,
    "tag": lambda entry: (*entry.facts.tags, *entry.tags),
    "flag": lambda entry: entry.facts.flags,
    "verdict": lambda entry: (entry.verdict,),
    "operator": lambda entry: (entry.facts.operator,),
    "name": lambda entry: (entry.facts.name,),
}
_MEASURES = ("after", "before", "longer", "shorter")

"""Sealed effects: put into a session file so that a look at its attributes does not give them away.

A seal keeps an honest person honest. It is not cryptography: whoever reads this module can open it.
"""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.twin.effect_table import EFFECTS

NOTHING = 0.15
"""Probability that ``--hidden`` leaves the bench as the nominal model has it."""

STRENGTH_RANGE = (0.6, 1.6)
"""A hidden effect has between these times its default strength, evenly in the logarithm."""

DIGEST_CHARACTERS = 16
SEAL_CHARACTERS = 1200
"""Every seal is filled up to this length, so that its length says nothing."""


def pick_hidden(phases: Sequence[str], rng: np.random.Generator) -> dict[str, dict[str, float]]:
    """One effect that acts in at least one of ``phases``, all equally likely, or none."""
    possible = [e for e in EFFECTS.values() if e.phases & set(phases)]
    effect = possible[int(rng.integers(len(possible)))]
    factor = float(np.exp(rng.uniform(*np.log(STRENGTH_RANGE))))
    if rng.random() < NOTHING:
        return {}
    values = effect.defaults()
    first = effect.parameters[0]
    values[first.name] = float(np.clip(values[first.name] * factor, first.low, first.high))
    return {effect.id: values}


def seal(content: Mapping[str, Any]) -> str:
    """Seal a JSON object into text of constant length."""
    text = json.dumps(content, sort_keys=True).encode("utf-8")
    digest = hashlib.sha256(text).hexdigest()[:DIGEST_CHARACTERS]
    body = base64.b64encode(zlib.compress(text, 9)).decode("ascii")
    filler = hashlib.shake_256(text).hexdigest(SEAL_CHARACTERS // 2)
    return (digest + body + "." + filler)[:SEAL_CHARACTERS]


def unseal(text: str, where: str) -> dict[str, Any]:
    """Open a seal.

    Raises:
        UserError: the text is no seal, or was changed.
    """
    digest, body = text[:DIGEST_CHARACTERS], text[DIGEST_CHARACTERS:].partition(".")[0]
    try:
        content = zlib.decompress(base64.b64decode(body, validate=True))
        if hashlib.sha256(content).hexdigest()[:DIGEST_CHARACTERS] != digest:
            raise ValueError("its digest does not match")
        result: dict[str, Any] = json.loads(content)
    except (ValueError, zlib.error) as error:
        raise UserError(f"The seal of {where} is damaged ({error}); simulate the session again.") from None
    return result

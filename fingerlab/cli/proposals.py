"""A trajectory as a person hands it to ``record`` and ``simulate``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fingerlab.errors import UserError


def read_proposal(text: str) -> dict[str, Any]:
    """A trajectory, a proposal, or a whole diagnosis, from JSON text or a file of it.

    Raises:
        UserError: it is none of them.
    """
    where = "--trajectory"
    if not text.lstrip().startswith("{"):
        where = text
        try:
            text = Path(text).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(
                f"--trajectory {where} is neither JSON text nor a file that can be read ({error})."
            ) from None
    try:
        data = json.loads(text)
    except ValueError as error:
        raise UserError(f"{where} is not JSON ({error}); give a trajectory or what diagnose wrote.") from None
    if isinstance(data, dict) and "next_experiment" in data:
        data = data["next_experiment"]
        if data is None:
            raise UserError(f"{where} proposes no experiment: its diagnosis has nothing left to separate.")
    if not isinstance(data, dict):
        raise UserError(f"{where} is not a JSON object; it should hold 'trajectory', or 'kind' and the like.")
    return data if "trajectory" in data else {"trajectory": data}

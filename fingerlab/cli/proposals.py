"""One run instead of a protocol, for ``simulate`` and ``record``: a trajectory or a proposal."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fingerlab.core.errors import UserError

if TYPE_CHECKING:
    from fingerlab.twin.protocols import RunPlan

TRAJECTORY_HELP = (
    "Take one run with this trajectory instead of a protocol: JSON text, a file of it, or what 'inverse' or "
    "'diagnose --json' gave."
)


def single_plan(source: str, phase: str | None, cable: str | None) -> RunPlan:
    """The one run that was asked for; ``phase`` and ``cable`` given by hand come before the proposal's.

    Args:
        source: a trajectory, a proposal (``next_experiment``) or a whole diagnosis, as JSON text or as the
            name of a file of it.

    Raises:
        UserError: it is none of them, proposes nothing, or cannot be run; or the phase is missing.
    """
    from fingerlab.twin.protocols import single_run

    found = read_proposal(source)
    phase = phase or found.get("phase")
    if phase is None:
        raise UserError("--trajectory needs --phase: on_air, contact, motor_bench or free.")
    return single_run(found["trajectory"], phase, cable or found.get("cable"))


def read_proposal(text: str) -> dict[str, Any]:
    """A trajectory, a proposal, or a whole diagnosis; the answer holds 'trajectory', maybe phase and cable.

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

"""What encoder and angle sensors read once they are initialised: predefined, in the rig file or by hand.

Section ``[initial]`` of a rig file, each in degrees and each optional::

    [initial]
    position_deg = 0.0   # of the pulley
    mcp_deg = 0.0        # of the joints; without them the sensors keep their calibrated zero
    pip_deg = 0.0
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from fingerlab.acquisition.commands import Initialise
from fingerlab.core.errors import UserError
from fingerlab.rig.constants import Rig

NAMES = {"position_deg": "position", "mcp_deg": "mcp", "pip_deg": "pip"}
LARGEST_DEG = 360.0


def initial_of(rig: Rig) -> Initialise:
    """The predefined values of a rig; the pulley at 0 and the joints as calibrated where it names none.

    Raises:
        UserError: the section is no section, or an entry is unknown or no possible angle.
    """
    section = rig.extra.get("initial", {})
    if not isinstance(section, Mapping):
        raise UserError(f"The rig, [initial], is not a section; it should hold {', '.join(NAMES)}.")
    values: dict[str, float] = {}
    for name, value in section.items():
        if name not in NAMES:
            raise UserError(f"The rig, [initial], holds the unknown '{name}'; it knows {', '.join(NAMES)}.")
        good = isinstance(value, int | float) and not isinstance(value, bool)
        if not good or not abs(value) <= LARGEST_DEG:
            raise UserError(
                f"The rig, [initial] {name}, is {value!r}; it should be an angle of at most "
                f"{LARGEST_DEG:g} degrees."
            )
        values[NAMES[name]] = math.radians(value)
    return Initialise(**values)

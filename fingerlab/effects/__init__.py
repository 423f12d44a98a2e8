"""The catalogue: every physical effect that the nominal model may miss, each in a file of its own.

A module of this package that defines ``EFFECT`` is an effect. Nothing else names it: the command line, the
window, the report, the documents and the blind trials take it from :data:`CATALOGUE`.
"""

from __future__ import annotations

from fingerlab.core.errors import UserError
from fingerlab.core.trust import found_in
from fingerlab.effects import own
from fingerlab.effects.base import Effect, Example, Formula, Gain, Row, Term
from fingerlab.physics.motion import Motion

ORDER = (
    *("viscous_friction", "coulomb_friction", "stribeck_friction", "presliding_hysteresis"),
    *("spring_hardening", "stiffness_error", "joint_coupling", "viscoelastic_creep", "joint_stop"),
    *("gravity_tilt", "added_mass", "distal_rotation"),
    *("cable_slack", "cable_stretch", "backlash", "varying_moment_arm", "capstan_friction"),
    *("motor_coulomb_friction", "motor_viscous_friction", "motor_inertia", "motor_stribeck_friction"),
    *("motor_presliding", "asymmetric_friction", "load_dependent_friction", "motor_spring", "torque_ripple"),
    *("transport_delay", "angle_sensor_nonlinearity", "sensor_drift", "load_cell_gain"),
    *("contact_angle", "contact_compliance", "routing_change"),
)
"""Order of the catalogue, by family. An effect that is not named here comes behind these, by its id."""
EVERYDAY = (
    "motor_inertia",
    "routing_change",
    "cable_slack",
    "capstan_friction",
    "cable_stretch",
    "coulomb_friction",
    "motor_coulomb_friction",
    "viscous_friction",
    "motor_viscous_friction",
    "transport_delay",
    "contact_angle",
)
"""What every bench has before anybody measured it, each by its plainest law: what turns has mass and rubs,
dry and wet; a cable hangs loose, gives, rubs in its sheath, lies where it was put; channels pass devices; no
face is straight. On a bench far from its model all is fitted first, in this order (kinematics); assumed."""


CATALOGUE: dict[str, Effect] = found_in(__path__, __name__, ORDER)
"""Effect by id."""


def whole_catalogue() -> dict[str, Effect]:
    """The catalogue and, after it, the user's own effects that they have confirmed; by id.

    Raises:
        UserError: the settings of the user's own effects are damaged.
    """
    return CATALOGUE | {e.id: e for file in own.own_files(CATALOGUE) for e in file.effects}


def effect(name: str) -> Effect:
    """The effect with the id ``name``, the user's own ones included.

    Raises:
        UserError: there is no such effect.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    known = whole_catalogue()
    if name not in known:
        waiting = " ".join(own.notices(CATALOGUE))
        raise UserError(
            f"There is no effect '{name}'; the catalogue holds {', '.join(known)}. {waiting}".strip()
        )
    return known[name]


def find_effect(name: str) -> Effect | None:
    """The effect with the id ``name``, or None: a result may name one that is no longer there."""
    return CATALOGUE.get(name) or whole_catalogue().get(name)


__all__ = [
    "CATALOGUE",
    "EVERYDAY",
    "Effect",
    "Example",
    "Formula",
    "Gain",
    "Motion",
    "Row",
    "Term",
    "effect",
    "find_effect",
    "whole_catalogue",
]

"""Angles and force are recorded late: the fit shifts the motor's channels; there is no column.

What other effects make of the motor's channels is as late as was found before (``transmission.LATE``).
"""

from fingerlab.effects.base import Effect, Example, Formula, Row
from fingerlab.effects.transmission import LATE, no_columns
from fingerlab.physics.parameter import Parameter

EFFECT = Effect(
    id="transport_delay",
    title="Late recording of joint angles and force",
    family="Sensors",
    acts_on=("joint_torque", "cable_kinematics"),
    gains={"delay": Parameter("s", 0.0, 0.19, 0.02, title="delay")},
    columns=no_columns,
    coordinate="motor speed",
    equation=Row.CABLE,
    explanation="Angles and force follow the motor's own channels after a constant time.",
    reveal="a chirp, in which a delay grows with frequency",
    mend="Sample all channels by one clock, with the same filters; a slower motion makes it smaller.",
    special="delay",
    followed={"delay": "Delay"},
    follows={LATE: ("delay",)},
    formula=Formula(
        equation=r"\theta_j^{\text{rec}}(t) = \theta_j(t-d),\qquad F^{\text{rec}}(t) = F(t-d)",
        symbols="d: delay of angles and force behind the motor's own channels.",
        source=("The thesis finds 162.2 ms between tension and joint torque and lets runs be shifted by it."),
        values={"delay": "d"},
        alike=("viscous_friction", "motor_viscous_friction", "cable_stretch"),
    ),
    example=Example({}, {"velocity": 1.0}, {}),
)

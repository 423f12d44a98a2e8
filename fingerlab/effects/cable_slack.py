"""The cable hangs loose: the fit counts the cable equation one-sidedly; there is no column.

When it does is told by the tension, less what motor and gearbox were found to keep for themselves.
"""

from fingerlab.effects.base import Effect, Example, Formula, Row
from fingerlab.effects.transmission import DRIVE, no_columns

EFFECT = Effect(
    id="cable_slack",
    title="Cable slack",
    family="Cable",
    acts_on=("cable_kinematics",),
    gains={},
    columns=no_columns,
    coordinate="tension",
    equation=Row.CABLE,
    explanation="At about zero tension the motor pays out cable that the joints do not take up.",
    reveal="a sine whose offset is so low that the cable is let out entirely",
    mend="Raise the pretension, or the offset of the motion, so that the cable never hangs loose.",
    special="slack",
    follows=DRIVE,
    formula=Formula(
        equation=r"x_m - x_0 \leq s(a\theta_1 + b\theta_2)\quad\text{where } T \approx 0",
        symbols=(
            "The cable equation becomes an inequality below a tension of 0.12 N: what is let out "
            "beyond it hangs loose."
        ),
        source="The thesis suspects it and has no equation for it; the inequality is ours.",
        alike=("cable_stretch", "backlash"),
    ),
    example=Example({}, {"position": 0.3}, {}),
)

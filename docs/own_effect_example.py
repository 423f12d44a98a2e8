"""An effect of your own: motor-side friction that grows with the square root of speed.

Put a file like this one into a folder of your own, then

    fingerlab effects --folder THAT_FOLDER
    fingerlab effects --trust own_effect_example.py

and ``fingerlab diagnose`` ranks it, explains it and draws it like the effects of the catalogue. Nothing in
the file runs before you have confirmed it, nor after a change until you confirm it again.

Why the square root: a gear that runs partly on grease and partly on metal loses less than a viscous one at
high speed and less than a dry one at low speed. The columns are plain numpy, in SI units.
"""

import numpy as np

from fingerlab.effects import Effect, Example, Formula, Gain, Motion, Row, Term


def columns(motion: Motion, shape: dict[str, float]) -> list[Term]:
    """The modelled torque for a gain of 1, on the time axis of ``motion``; arrays of shape (n,)."""
    torque = np.sign(motion.velocity) * np.sqrt(np.abs(motion.velocity))  # velocity: motor, rad/s
    if motion.finger is None:  # a motor-bench run has one equation, in N m
        return [Term(Row.BENCH, "root", torque)]
    # On the finger the motor's channel is compared as a tension (N) with that of either joint.
    tension = torque / motion.radius
    return [Term(Row.MCP, "root", tension), Term(Row.PIP, "root", tension)]


EFFECT = Effect(
    id="motor_root_friction",
    title="Motor friction with the square root of speed",
    acts_on=("motor_torque",),
    gains={
        "root": Gain(
            unit="N m (s/rad)^0.5",
            low=0.0,
            high=0.05,
            typical=0.003,  # a strength that would matter
            source="assumed",
            title="friction coefficient",
        )
    },
    columns=columns,
    coordinate="motor speed",  # what the misfit is drawn against
    equation=Row.PIP,  # in which equation
    explanation="Both joints miss the same tension, which grows with the square root of motor speed.",
    reveal="a motor-bench run at several speeds",
    bench=True,  # it can act on the motor bench, without a finger
    wanders=True,  # friction differs by some per cent from run to run
    formula=Formula(  # what the report prints
        equation=r"\tau_m = S\,\mathrm{sgn}(\dot\theta_m)\sqrt{|\dot\theta_m|}",
        symbols="S: friction coefficient.",
        source="Made up for this page.",
        values={"root": "S"},
    ),
    # A motor that turns back at 4 rad/s: the tension for a gain of 1, over a pulley of 10 mm.
    example=Example({}, {"velocity": -4.0}, {"MCP root": -200.0, "PIP root": -200.0}),
)

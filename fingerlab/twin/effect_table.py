"""The catalogue as physics: one table of what each effect is in the simulated bench, and how strong.

Strengths are chosen so that an effect matters on a bench whose joints carry some 0.04 N m, whose cable
carries some 5 N and whose motor sees some 0.07 N m. Ranges are what such an effect could plausibly
have on a printed finger with an RE40 drive.
"""

from __future__ import annotations

from fingerlab.twin import plant_changes as changes
from fingerlab.twin.effects import CONTACT, MOTOR_BENCH, ON_AIR, PlantEffect, constant

FINGER = frozenset({ON_AIR, CONTACT})
DRIVE = frozenset({ON_AIR, CONTACT, MOTOR_BENCH})
TOUCH = frozenset({CONTACT})

P = constant
RATIO = P("pip_ratio", "", 0.6, 0.3, 1.0, "assumed: smaller hinge")
WIND_UP = P("travel", "rad", 1.5e-3, 5e-4, 5e-3, "assumed: elastic wind-up before it slides")
GEAR_WIND_UP = P("travel", "rad", 4e-3, 1e-3, 1e-2, "assumed: gearbox wind-up before it slides")

_TABLE = (
    PlantEffect(
        "viscous_friction",
        "Grease in both hinges.",
        (P("mcp", "N m s/rad", 2.5e-3, 5e-4, 8e-3), RATIO),
        FINGER,
        changes.viscous,
    ),
    PlantEffect(
        "coulomb_friction",
        "Both hinges rub: a spring-slider that truly sticks.",
        (P("mcp", "N m", 2.5e-3, 6e-4, 8e-3), RATIO, WIND_UP),
        FINGER,
        changes.joint_coulomb,
    ),
    PlantEffect(
        "stribeck_friction",
        "Both hinges rub, and break away harder than they slide.",
        (
            P("mcp", "N m", 2.0e-3, 5e-4, 6e-3),
            P("excess", "", 1.0, 0.3, 2.0, "assumed: breakaway over sliding level"),
            P("speed", "rad/s", 0.3, 0.05, 1.0, "assumed: half of the excess is gone"),
            RATIO,
            WIND_UP,
        ),
        FINGER,
        changes.joint_stribeck,
    ),
    PlantEffect(
        "presliding_hysteresis",
        "Soft seals in both hinges: friction that builds up over degrees (spring-sliders in a row).",
        (
            P("mcp", "N m", 3.0e-3, 8e-4, 8e-3),
            P("travel", "rad", 0.12, 0.03, 0.3),
            RATIO,
        ),
        FINGER,
        changes.joint_presliding,
    ),
    PlantEffect(
        "spring_hardening",
        "Joint springs with a cubic term.",
        (P("mcp", "N m/rad^3", 0.35, 0.08, 1.2), RATIO),
        FINGER,
        changes.hardening,
    ),
    PlantEffect(
        "stiffness_error",
        "Joint springs stiffer than the rig file says.",
        (P("relative", "", 0.25, -0.5, 0.6), P("pip_ratio", "", 1.0, 0.0, 1.5)),
        FINGER,
        changes.stiffness,
    ),
    PlantEffect(
        "joint_coupling",
        "A spring that pulls the two joint angles together (glove, skin, tendon).",
        (P("stiffness", "N m/rad", 0.025, 5e-3, 0.08),),
        FINGER,
        changes.coupling,
    ),
    PlantEffect(
        "viscoelastic_creep",
        "A relaxing spring beside each joint spring.",
        (
            P("relative", "", 0.3, 0.08, 1.0, "assumed: instantaneous over relaxed stiffness, less one"),
            P("time", "s", 0.8, 0.1, 5.0, "assumed: silicone and printed ABS"),
        ),
        FINGER,
        changes.creep,
    ),
    PlantEffect(
        "joint_stop",
        "The PIP hinge meets a stop in extension.",
        (
            P("stiffness", "N m/rad^1.5", 0.8, 0.2, 5.0),
            P("angle", "rad", -0.28, -0.5, -0.1),
            P("damping", "s/rad", 0.2, 0.0, 1.0),
        ),
        FINGER,
        changes.stop,
    ),
    PlantEffect(
        "gravity_tilt",
        "The base stands at another angle than the wrist angle in the rig file.",
        (P("angle", "rad", 0.26, 0.05, 0.6, "assumed: 15 degrees"),),
        FINGER,
        changes.tilt,
    ),
    PlantEffect(
        "added_mass",
        "Screws, magnets and covers on the distal body and at the PIP axis.",
        (
            P("distal", "kg", 6.0e-3, 1e-3, 1.5e-2, "assumed: M3 screws, ring magnet, cover"),
            P("knuckle_ratio", "", 0.7, 0.0, 2.0),
        ),
        FINGER,
        changes.mass,
    ),
    PlantEffect(
        "distal_rotation",
        "The distal body's spin counts with its absolute speed, as it really does.",
        (P("share", "", 1.0, 0.0, 1.0, "0 is the thesis' energy, 1 is rigid-body mechanics"),),
        FINGER,
        changes.rotation,
    ),
    PlantEffect(
        "varying_moment_arm",
        "Cable guides whose lever changes as the joint turns.",
        (
            P("slope", "1/rad", 0.45, 0.1, 1.2, "assumed: straight cable between guides"),
            P("pip_ratio", "", 0.8, 0.3, 1.2),
        ),
        FINGER,
        changes.varying_arm,
    ),
    PlantEffect(
        "capstan_friction",
        "The cable rubs in its sheath and sticks there at reversal.",
        (P("wrap", "", 0.18, 0.05, 0.6, "friction 0.1 to 0.2 times the bend; Kaneko's sheath model"),),
        FINGER,
        changes.capstan,
    ),
    PlantEffect(
        "cable_slack",
        "Dead travel: the cable hangs loose until this length is wound.",
        (P("travel", "m", 3.5e-3, 8e-4, 8e-3, "thesis chapter 5: 'some slack'; size assumed"),),
        FINGER,
        changes.slack,
    ),
    PlantEffect(
        "cable_stretch",
        "A compliant cable.",
        (
            P("compliance", "m/N", 3.5e-4, 5e-5, 3e-3, "assumed: polymer cable or glove fabric"),
            P("damping_time", "s", 4e-3, 1e-3, 2e-2),
        ),
        FINGER,
        changes.stretch,
    ),
    # Idealised: the cable's torque reaches the motor also while the gap is crossed. Under a cable that only
    # pulls, a free pulley would rest against one flank for ever and play would never show.
    PlantEffect(
        "backlash",
        "Play between gearbox and pulley, whose bearing holds it where it was left until the gap is closed.",
        (P("play", "rad", 0.015, 4e-3, 0.025, "GP 42C data sheet: below 1 degree; keyed pulley adds to it"),),
        FINGER,
        changes.backlash,
    ),
    PlantEffect(
        "motor_coulomb_friction",
        "Motor and gearbox rub.",
        (
            P("torque", "N m", 6.0e-3, 1.5e-3, 2.5e-2, "RE40 no-load current 137 mA is 17.8 mN m"),
            GEAR_WIND_UP,
        ),
        DRIVE,
        changes.motor_coulomb,
    ),
    PlantEffect(
        "motor_viscous_friction",
        "Grease in motor and gearbox.",
        (P("coefficient", "N m s/rad", 4.0e-3, 5e-4, 1.5e-2),),
        DRIVE,
        changes.motor_viscous,
    ),
    PlantEffect(
        "motor_inertia",
        "A coupling and a larger pulley on the output shaft.",
        (P("inertia", "kg m^2", 4.0e-4, 1e-4, 2e-3, "assumed: steel disc of 40 mm"),),
        DRIVE,
        changes.motor_inertia,
    ),
    PlantEffect(
        "motor_stribeck_friction",
        "Motor and gearbox rub, and break away harder than they slide.",
        (
            P("torque", "N m", 4.5e-3, 1e-3, 2e-2),
            P("excess", "", 1.0, 0.3, 2.0, "assumed: breakaway over sliding level"),
            P("speed", "rad/s", 0.25, 0.05, 1.0),
            GEAR_WIND_UP,
        ),
        DRIVE,
        changes.motor_stribeck,
    ),
    PlantEffect(
        "motor_presliding",
        "Seals of motor and gearbox: friction that builds up over degrees.",
        (P("torque", "N m", 7.0e-3, 2e-3, 2.5e-2), P("travel", "rad", 0.15, 0.04, 0.4)),
        DRIVE,
        changes.motor_presliding,
    ),
    PlantEffect(
        "asymmetric_friction",
        "Motor and gearbox rub more in one direction than in the other.",
        (
            P("torque", "N m", 6.0e-3, 1.5e-3, 2.5e-2, "mean of the two directions"),
            P("asymmetry", "", 0.5, -0.9, 0.9),
            GEAR_WIND_UP,
        ),
        DRIVE,
        changes.asymmetric,
    ),
    PlantEffect(
        "load_dependent_friction",
        "Tooth friction: a share of the torque transmitted is lost in either direction.",
        (P("share", "", 0.13, 0.03, 0.35, "GP 42C efficiency 90 %; more when dry"), GEAR_WIND_UP),
        DRIVE,
        changes.load_dependent,
    ),
    PlantEffect(
        "motor_spring",
        "An elastic torque at the output shaft (cable loop, seals, return spring).",
        (P("stiffness", "N m/rad", 0.03, 5e-3, 0.15),),
        DRIVE,
        changes.motor_spring,
    ),
    PlantEffect(
        "torque_ripple",
        "Torque that repeats with the motor angle (gear mesh, commutation).",
        (P("torque", "N m", 4.0e-3, 1e-3, 1.5e-2), P("order", "1/rev", 22.0, 8.0, 60.0)),
        DRIVE,
        changes.ripple,
    ),
    PlantEffect(
        "transport_delay",
        "Joint angles and force reach the recorder later than the motor's own channels.",
        (P("delay", "s", 0.04, 5e-3, 0.2, "thesis section 4.2 saw 162 ms; cause open"),),
        FINGER,
        changes.delay,
    ),
    PlantEffect(
        "angle_sensor_nonlinearity",
        "Offset and unequal amplitude of the angle sensors' bridges.",
        (
            P(
                "angle",
                "rad",
                0.03,
                8e-3,
                0.08,
                "KMA210 data sheet: error up to 1.1 degrees; misplaced magnet more",
            ),
        ),
        FINGER,
        changes.bridge,
    ),
    PlantEffect(
        "sensor_drift",
        "The MCP angle sensor drifts as it warms up.",
        (
            P(
                "angle",
                "rad",
                0.03,
                8e-3,
                0.1,
                "KMA210 data sheet: 0.64 degrees over temperature; more assumed",
            ),
        ),
        FINGER,
        changes.drift,
    ),
    PlantEffect(
        "load_cell_gain",
        "The load cell reads too much.",
        (P("relative", "", 0.15, -0.3, 0.3, "FC2231 span is good to 5 %; a wrong calibration does more"),),
        TOUCH,
        changes.cell_gain,
    ),
    PlantEffect(
        "contact_angle",
        "The fingertip presses on a face that leans from the load cell's axis.",
        (P("angle", "rad", 0.45, 0.1, 1.05, "thesis figure 5.2 tried up to 60 degrees"),),
        TOUCH,
        changes.contact_angle,
    ),
    PlantEffect(
        "contact_compliance",
        "A soft fingertip on the load cell.",
        (P("compliance", "m/N", 1.0e-3, 2e-4, 4e-3, "assumed: silicone cap"),),
        TOUCH,
        changes.contact_compliance,
    ),
    PlantEffect(
        "routing_change",
        "The flexion cable passes the MCP closer and the PIP farther than the bench expects.",
        (P("relative", "", 0.35, -0.5, 0.5),),
        FINGER,
        changes.routing,
    ),
)

EFFECTS: dict[str, PlantEffect] = {effect.id: effect for effect in _TABLE}
"""Every effect of the catalogue, by id, in its order."""

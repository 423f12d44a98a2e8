"""A second bench for blind trials, built on MuJoCo: it shares no physics with the project.

``session.record`` writes a session file; ``python -m tests.hidden.sweep --kind engine`` runs trials.
MuJoCo brings the mechanics (rods, tendons, contact), the integrator, and its own laws for friction that
sticks, joint limits, polynomial springs and dampers. Only the file format is common with FingerLab.
"""

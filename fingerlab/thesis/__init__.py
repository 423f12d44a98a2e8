"""The thesis' analysis, step by step: chapters 4 and 5.

Entry points: :func:`fit_session` (moment arms and losses), :func:`fit_motor_bench`,
:func:`predict_session` (contact force from fitted parameters) and :func:`thesis_analysis` (every number
that the thesis published). Nothing is imported here, so that each command loads only what it needs.
"""

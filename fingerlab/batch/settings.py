"""Every number by which a batch weighs what became of a bench, each with its reason."""

from __future__ import annotations

from collections.abc import Mapping

LEAST_SESSIONS = 3
"""Fewer have no course: two levels are all that two sessions can show."""
PROBABLE = 0.5
"""From this probability on a change is named: it is likelier than everything else together."""
CERTAIN_AT_ENDS = 0.8
"""... and from this one on where the first or the last session alone is otherwise: a step and a session that
went wrong are then the same numbers, and what tells them apart is assumed; assumed."""
BARELY = 3.0
"""Bayes factor below which nothing was learned either way; Jeffreys, Theory of Probability, 1961, appendix B:
up to the square root of ten "not worth more than a bare mention"."""
MOSTLY = 0.5
"""An effect is in the models of a side if it is in more than so many of them; assumed."""

KINDS: Mapping[str, float] = {
    "step": 0.12,
    "new": 0.10,
    "gone": 0.08,
    "wear": 0.20,
    "settling": 0.08,
    "warm_up": 0.12,
    "odd": 0.30,
}
"""What a change may be, and its share beforehand; assumed. A session that went wrong is as usual as a step:
of a last session alone nobody can say which it is. What a quantity or its sessions cannot have gives its
share to the others (warming up without two sessions of one sitting), an effect that comes or goes, where
nothing can be absent, to the step."""
STEPS = ("step", "new", "gone")
"""Kinds that have a moment."""

LEVEL = 2.0
"""Standard deviation of a level beforehand, in strengths that would matter (``Parameter.typical``);
assumed."""
SIZES = (1.0 / 27.0, 1.0 / 9.0, 1.0 / 3.0, 1.0, 3.0)
"""Standard deviations of a change beforehand, in strengths that would matter, each as likely; assumed: from
what is seen of a good bench to an effect at three times its usual size."""
BEYOND = 3.0
"""Where numbers are further than so many strengths from nominal, the strength is widened to that; assumed."""
SCATTER = 0.03
"""Half of all benches scatter less from session to session, in strengths that would matter (half-Cauchy,
Gelman, Bayesian Analysis 1, 2006, 515-533); assumed: some per cent, as friction does from run to run."""
SHARED: Mapping[float, float] = {0.25: 0.25, 0.5: 0.25, 1.0: 0.5}
"""Share of a session's interval that is its own, and how likely that is beforehand; assumed. The rest is what
all sessions of a bench have in common, such as the tolerances of its rig file, and moves nothing."""
SCATTERS = 32
"""Values of the scatter over which its weight is summed, evenly in the logarithm."""
LEAST_SCATTER = 0.02
"""The smallest of them, in the sessions' own errors or, without these, in the spread of the numbers."""

WITHIN = 0.25
"""How likely a step is within a sitting, against one in a pause, in which a bench is repaired; assumed."""
SETTLING_SHARES = (0.08, 0.16, 0.32)
"""What settles runs in with use: its constants, as shares of all use from first to last session; longer is a
straight line, shorter a step after the first one; assumed."""
WARMING_MIN = (10.0, 20.0, 40.0, 80.0)
"""Time constants of warming up, minutes; assumed: a gear motor's housing takes tens of minutes."""
PAUSE_H = 3.0
"""A longer pause lets a bench cool down, hours; assumed: three of the longer time constants, and more."""

BETWEEN: Mapping[str, float] = {"same": 0.25, "differs": 0.25, "first": 0.15, "second": 0.15, "neither": 0.2}
"""Of an effect on two benches beforehand: both have it alike, both of another strength, one alone, none;
assumed."""

"""Which physical effect the model is missing: the question, from sessions to an answer.

One pass over the data reduces it to products of features; everything after that is small linear algebra. The
rooms, each of which imports those before it alone:

    signals     runs to segments of motion, bandwidths, conditions
    equations   features, the order of their columns, unknowns and their ranges, coefficients
    gram        decimation, sums of one run, groups, the reduction of all sessions
    fit         noise, weights, the solver
    score       models fitted and scored held out, what an effect must explain, probabilities
    search      the next effect, the path to all that is missing, shapes between the points of a grid
    experiment  the runs that the rig can do, their predicted motion, and the one to propose
    answer      results, errors, curves and words

``diagnose`` leads through them.
"""

from fingerlab.diagnosis.diagnose import DiagnosisOptions, diagnose

__all__ = ["DiagnosisOptions", "diagnose"]

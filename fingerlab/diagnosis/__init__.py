"""Which physical effect the model is missing: the question, from sessions to an answer.

One pass over the data reduces it to products of features; everything after that is small linear algebra. The
rooms, each of which imports those before it alone:

    signals     runs to segments of motion, bandwidths, conditions
    equations   features, the order of their columns, unknowns and their ranges, coefficients
    gram        decimation, sums of one run, groups, the reduction of all sessions
    fit         noise, weights, the solver

and beside them, file by file:

    trial, reach -> study                                      fitted, and scored held out
    trial -> steps -> odds -> evidence -> unseen               what the scores say
    study, evidence -> search -> path -> second_look -> diagnose   which effect next, how many
"""

from fingerlab.diagnosis.diagnose import diagnose

__all__ = ["diagnose"]

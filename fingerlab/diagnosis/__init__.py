"""Which physical effect the model is missing: the question, from sessions to an answer.

One pass over the data reduces it to products of features (``reduction``); everything after that is small
linear algebra. See ``features`` for how the equations are written. Who imports whom, one way:

    stretches, features, columns, narrowing, reading, sharing -> reduction   what the recordings hold
    groups, model, noise, weighing, numerics -> fitting                      one model and its best values
    fitting -> trial, reach -> study                                         fitted, and scored held out
    trial -> steps -> odds -> evidence -> unseen                             what the scores say
    study, evidence -> search -> path -> second_look -> diagnose             which effect next, how many
"""

from fingerlab.diagnosis.diagnose import diagnose

__all__ = ["diagnose"]

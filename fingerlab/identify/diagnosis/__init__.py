"""Which physical effect the model is missing: the question, from sessions to an answer.

One pass over the data reduces it to products of features (``reduction``); everything after that is small
linear algebra (``study``, ``search``, ``evidence``). See ``features`` for how the equations are written.
"""

from fingerlab.identify.diagnosis.diagnose import diagnose

__all__ = ["diagnose"]

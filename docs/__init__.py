"""The documents, which the installed program has as ``fingerlab.documents``."""

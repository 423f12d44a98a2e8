"""Sessions, diagnoses and models for scripts and notebooks: objects that print what they hold.

Nothing is computed here: the objects call what the commands call, and show it in the same words. The
functions that open, simulate, diagnose and fit are offered by ``import fingerlab``.
"""

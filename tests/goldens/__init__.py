"""Goldens: what the program says of many recordings, kept to the last bit (``python -m tests.goldens``)."""

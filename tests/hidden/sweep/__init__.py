"""The full sweep of blind trials: ``python -m tests.hidden.sweep``."""

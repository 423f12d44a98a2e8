"""From channels to filtered signals with their derivatives, regions and delays, once and in one place."""

from fingerlab.signals.prepare import Signals, low_pass, prepare

__all__ = ["Signals", "low_pass", "prepare"]

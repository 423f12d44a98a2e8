"""Machines with one axis: a plant of our own, real recordings, and what a plain regression makes of both."""

"""Runs in their order, by a protocol or by a script, on any bench."""

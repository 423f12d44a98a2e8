"""Fit, compare, diagnose, next experiment."""

"""Fitting a model to the sums: noise, weights, solver."""

"""Endpoint force of contact runs from a model that a diagnosis fitted, with an interval that holds."""

from fingerlab.prediction.extended import EQUATIONS, ExtendedModel, Variant, extended_model, model_of_extended
from fingerlab.prediction.predict import ExtendedPrediction, fit_extended, fit_steps, predict_extended

__all__ = [
    "EQUATIONS",
    "ExtendedModel",
    "ExtendedPrediction",
    "Variant",
    "extended_model",
    "fit_extended",
    "fit_steps",
    "model_of_extended",
    "predict_extended",
]

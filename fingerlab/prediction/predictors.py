"""What a model file can say of a torque to come: its predictors by name, the one to start with first."""

from __future__ import annotations

from collections.abc import Mapping

from fingerlab.models.file import DIAGNOSIS_METHOD, Model
from fingerlab.prediction.inverse import Predictor
from fingerlab.prediction.storing import extended_model
from fingerlab.signals.regions import REGION_TITLES
from fingerlab.thesis.models import parameter_sets
from fingerlab.thesis.specs import JOINT_TITLES

FIRST = ("extension", "whole", "flexion")
"""Regions in the order of trust: the thesis ended with those of extension."""


def predictors(model: Model, where: str, cable: str = "flexion") -> Mapping[str, Predictor]:
    """Predictors that do not switch with the region, by words for a list; the best first.

    Args:
        where: the model's file, for the error's sentence. cable: of the contact; its sets come first.

    Raises:
        UserError: the model predicts no force.
    """
    if model.method == DIAGNOSIS_METHOD:
        found = extended_model(model, where)
        return {
            found.words if name == "extended" else "nominal model": v for name, v in found.variants.items()
        }
    sets = [one for one in parameter_sets(model, where).values() if not one.switches]
    sets.sort(key=lambda one: (one.joint != "pip", one.cable != cable, FIRST.index(one.name)))
    return {
        f"{JOINT_TITLES[one.joint]}, {REGION_TITLES.get(one.name, one.name)}, {one.cable} cable": one
        for one in sets
    }

"""Volts to units: a straight line from a stepped recording, compared with the sensor's data sheet."""

from fingerlab.calibration.line import Calibration, SteadyStep, StepTiming, calibrate_steps, find_steps
from fingerlab.calibration.sensors import SENSORS, Sensor

__all__ = ["SENSORS", "Calibration", "Sensor", "SteadyStep", "StepTiming", "calibrate_steps", "find_steps"]

"""The equations of motion as features with coefficients: columns, parameters, models."""

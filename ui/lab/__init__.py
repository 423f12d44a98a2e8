"""The Model lab: see model and measurement, find where they part, name what is missing, add it."""

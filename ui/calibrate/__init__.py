"""The Calibrate tab: load cell and angle sensors, step by step."""

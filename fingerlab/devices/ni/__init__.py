"""The NI card, through the nidaqmx package."""

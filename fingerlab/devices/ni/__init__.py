"""The real card, driven through ``nidaqmx``, which is imported only when a card is asked for."""

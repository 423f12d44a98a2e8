"""What the explanations say of the error agrees with the headline, digit by digit."""

from __future__ import annotations

import re

import numpy as np

from tests.cli.test_row_and_headline import CYCLES, FRICTION, PERIOD, RATE, session, told


def test_an_explanation_begins_with_the_error_of_the_headline(tmp_path, capsys):
    """22.78 beside 22.8 is one number too many, and from 22.8 to 22.8 nothing goes."""
    time = np.arange(0.0, PERIOD * CYCLES, 1 / RATE)
    swings = [a * np.sin(2 * np.pi * time / PERIOD) for a in (0.3, 0.5, 0.7)]
    runs = [(q, FRICTION * np.tanh(np.gradient(q) * RATE / 0.05)) for q in swings]
    said, headline, _, _ = told(session(tmp_path, capsys, runs), capsys)
    falls = re.findall(r"held-out error goes from ([\d.]+) to ([\d.]+) floors", said)
    assert falls
    for before, after in falls:
        assert float(before) == headline
        assert before != after

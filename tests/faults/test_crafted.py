"""A part of the crafted files in every run of the tests; ``python -m tests.faults.crafted`` tries all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fingerlab.core.errors import UserError
from fingerlab.sessions import open_session
from tests.faults.crafted_sessions import SECRET, WAYS_OUT, crafted_sessions
from tests.faults.crafted_texts import crafted_texts

ROOT = Path(__file__).resolve().parents[2]


def test_there_are_enough_kinds() -> None:
    assert len(crafted_sessions()) + len(crafted_texts()) >= 250


@pytest.mark.skipif(not hasattr(os, "fork"), reason="each file is tried in a fork of its own")
def test_one_in_some_hundred_pairs_of_file_and_command() -> None:
    command = [sys.executable, "-m", "tests.faults.crafted", "--share", "907", "--flips", "40"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=200)
    assert done.stdout == ""  # what falls short would stand here
    assert int(done.stderr.split()[-2]) >= 6


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="one of them leads to a pipe")
@pytest.mark.parametrize("kind", WAYS_OUT)
def test_what_leads_to_another_file_is_refused_by_name(kind: str, tmp_path: Path) -> None:
    WAYS_OUT[kind](tmp_path / "session.h5")
    with pytest.raises(UserError, match="should hold all of itself") as refused:
        open_session(tmp_path / "session.h5")
    assert SECRET not in str(refused.value)

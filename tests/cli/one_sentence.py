"""How a command is run inside the tests, and how its refusal should look: one sentence, nothing touched."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from fingerlab.cli.main import main


def run_main(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return stop.value.code, captured.out, captured.err


def snapshot(folder: Path) -> dict[str, str]:
    """Every file below a folder with the hash of its content."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
        for path in folder.rglob("*")
    }


def assert_one_sentence(code, out, err, *words):
    assert code == 2, (code, out, err)
    assert out == ""
    assert "Traceback" not in err
    assert len(err.splitlines()) == 1, err
    assert err.startswith("fingerlab: ")
    for word in words:
        assert word in err

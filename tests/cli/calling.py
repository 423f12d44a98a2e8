"""Commands called as a user calls them, in this process."""

from __future__ import annotations

import pytest

from fingerlab.cli.main import main


def run_command(*arguments: object) -> int:
    """The exit code."""
    with pytest.raises(SystemExit) as stopped:
        main([str(a) for a in arguments])
    code = stopped.value.code
    return 0 if code is None else int(code)


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The sentence with which a command is refused: exit 2, nothing on standard output, no traceback."""
    capsys.readouterr()
    assert run_command(*arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    lines = err.strip().splitlines()
    assert len(lines) == 1, err
    return lines[0]

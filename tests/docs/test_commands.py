"""Every command that the documents name is run, in the order of its page, on short sessions."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import fingerlab.identify.diagnosis
import fingerlab.twin.protocols
from tests.docs.console import Console, console_lines
from tests.docs.shelf import ROOT, Remembered, fill, run, shortened, supply, thin_reports

DOCS = ROOT / "docs"
PAGES = (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))
CHECKED = DOCS / "hidden-effect.md"
NOT_RUN = {
    "it installs what the tests run with",
    "it needs the card",
    "it takes minutes",
    "it takes as long as the runs",
}
"""The reasons for which a command may be left out."""
MOST_LEFT_OUT = 12


def commands(page: Path) -> list[Console]:
    return list(console_lines(page.read_text(encoding="utf-8")))


WITH_COMMANDS = [page for page in PAGES if any(not c.reason for c in commands(page))]


@pytest.fixture(scope="module")
def patched() -> Iterator[pytest.MonkeyPatch]:
    with pytest.MonkeyPatch.context() as patch:
        yield patch


@pytest.fixture(scope="module")
def shelf(tmp_path_factory: pytest.TempPathFactory, patched: pytest.MonkeyPatch) -> Path:
    protocols = fingerlab.twin.protocols.PROTOCOLS
    for name, plans in list(protocols.items()):
        patched.setitem(protocols, name, shortened(plans))  # type: ignore[arg-type]
    diagnosis = fingerlab.identify.diagnosis
    patched.setattr(diagnosis, "diagnose", Remembered(diagnosis.diagnose))
    thin_reports(patched)
    folder = tmp_path_factory.mktemp("shelf")
    patched.setenv("FINGERLAB_SETTINGS_DIR", str(folder / "settings"))
    fill(folder)
    return folder


@pytest.mark.parametrize("page", WITH_COMMANDS, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_command_of_the_page_runs(
    page: Path, shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    monkeypatch.setattr("fingerlab.cli.effects._somebody_there", lambda: True)
    for command in commands(page):
        if page == CHECKED and command.words[0] != "report":
            continue  # run at their real length in test_worked_example.py
        if not command.reason:
            supply(command.words, shelf, tmp_path)
            run(command.words)


def test_few_commands_are_left_out_and_each_says_why() -> None:
    left_out = [c for page in PAGES for c in commands(page) if c.reason]
    assert {c.reason for c in left_out} <= NOT_RUN
    assert len(left_out) <= MOST_LEFT_OUT, [c.line for c in left_out]
    assert sum(not c.reason for page in PAGES for c in commands(page)) > 2 * len(left_out)


def test_marks_hold_for_their_block_alone() -> None:
    text = (
        "Text.\n\n<!-- not run: it takes minutes -->\n\n"
        "    fingerlab replicate    # all\n    fingerlab info a.h5\n\n"
        "More.\n\n    fingerlab fit a.h5\n\n```text\nfingerlab | a table\n```\n\nfingerlab fit b.h5\n"
    )
    assert list(console_lines(text)) == [
        Console("replicate", "it takes minutes"),
        Console("info a.h5", "it takes minutes"),
        Console("fit a.h5", ""),
        Console("fit b.h5", ""),
    ]

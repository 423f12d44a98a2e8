"""Every command that the documents name is run, in the order of its page, on short sessions."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

import fingerlab.batch.run
import fingerlab.batch.table
import fingerlab.diagnosis
import fingerlab.prediction
import fingerlab.report.content
import fingerlab.twin.protocols
from fingerlab.cli.main import cli
from fingerlab.effects import CATALOGUE
from tests.docs.console import INSTALLS, OURS, Console, console_lines, mentions, shell_lines
from tests.docs.shelf import (
    ASKED_FOR,
    ROOT,
    Remembered,
    fill,
    run,
    shortened,
    stop_the_clock,
    supply,
    thin_reports,
)

DOCS = ROOT / "docs"
PAGES = (
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "packaging/README.md", "packaging/LICENCES.md")),
    *sorted(DOCS.rglob("*.md")),
)
CHECKED = DOCS / "hidden-effect.md"
NOT_RUN = {
    "it installs what the tests run with",
    "it needs the card",
    "it takes minutes",
    "it moves a motor in real time",
}
"""The reasons for which a command may be left out."""
MOST_LEFT_OUT = 14
RUN_ELSEWHERE = {
    "mkdocs": ("tests/docs/test_documents.py", "build.build(config)"),
    "pip install": (".ci/run", "start.py"),  # the starter installs what these lines name
    "python docs/hidden_effect_story.py": ("tests/notebook/test_story.py", "hidden_effect_story.py"),
    "python -m tests.goldens": ("tests/goldens/test_goldens.py", "[command, str(folder), *words, *more]"),
    "python docs/structure.py": ("tests/docs/test_structure.py", "structure.rooms()"),
    "python packaging/bundle.py": (".ci/run", "packaging/bundle.py"),
    "python packaging/distribution.py": ("tests/packaging/test_packages.py", "distribution.build_both"),
    "python packaging/licences.py": ("tests/docs/test_documents.py", "licences.locked()"),
    "python packaging/try_wheel.py": (".ci/run", "packaging/try_wheel.py"),
    "python -m tests.diagnosis.metamorphic": (
        *("tests/diagnosis/metamorphic/test_metamorphic.py", "shuffled(resized(axis"),
    ),
    "python -m tests.faults.crafted": ("tests/faults/test_crafted.py", '"-m", "tests.faults.crafted"'),
    "python -m tests.faults.saving": ("tests/models/test_project.py", "kill_saving(place, chance)"),
    "python -m tests.faults.sensors": ("tests/faults/test_sensors.py", "try_once(lie, seed)"),
    "python -m tests.hidden.axis": ("tests/hidden/test_axis.py", "baselines(open_session(path))"),
    "python -m tests.hidden.dirt": ("tests/hidden/test_dirt.py", "dirt.WAYS[way](machine)"),
    "python -m tests.hidden.changes": ("tests/hidden/test_changes.py", "changes.figures(entries)"),
    "python -m tests.hidden.draft_laws": ("tests/hidden/test_draft_laws.py", "draft_laws.figures(entries)"),
    "python -m tests.hidden.wrong_additions": (
        *("tests/hidden/test_wrong_additions.py", "wrong_additions.figures(entries)"),
    ),
    "python start.py": (".ci/run", "start.py test"),
}
"""Commands of other programs: the file that runs the same, and the words by which it does."""
TAKES_HOURS = (
    *("benchmarks", "docs/screenshots.py", "packaging/lock.py"),
    *("tests.faults.stops", "tests.faults.sweep", "tests.hidden.sweep", "tests.hidden.as_built"),
    "tests.hidden.feed_forward",
    "tests.hidden.thesis_story",
)
"""Programs that measure for hours, draw all pictures, or ask the network: they exist, with their options."""


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
    others = [name for name in CATALOGUE if name not in ASKED_FOR]
    diagnose = Remembered(
        fingerlab.diagnosis.diagnose,
        whole=True,
        options=fingerlab.diagnosis.DiagnosisOptions(left_out=others),
    )
    for module in (fingerlab.diagnosis, fingerlab.batch.table):
        patched.setattr(module, "diagnose", diagnose)
    # In this process, which remembers.
    patched.setattr("fingerlab.cli.batch.locally", lambda jobs: fingerlab.batch.run.locally(1))
    fit = Remembered(fingerlab.prediction.fit_extended)
    for module in (fingerlab.prediction, fingerlab.report.content):
        patched.setattr(module, "fit_extended", fit)
    stop_the_clock(patched)
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
    monkeypatch.setattr("fingerlab.cli.effects.somebody_there", lambda: True)
    for command in commands(page):
        if page == CHECKED and command.words[0] != "report":
            continue  # run at their real length in tests/notebook/test_story.py
        if not command.reason:
            supply(command.words, shelf, tmp_path)
            run(quick(command.words))


def quick(words: list[str]) -> list[str]:
    """The command on the usual bench: of the bench as it was built, a dozen effects are found in a minute.

    What is found there is asked of the whole command in ``tests/hidden/as_built``, whose table is committed.
    """
    after = [*words[1:], ""]
    return [w for w, then in zip(words, after, strict=True) if "as-built" not in (w, then)]


def whole_mentions(page: Path) -> list[list[str]]:
    """Commands of FingerLab in the middle of a sentence that have all they need, and take seconds."""
    found = [m for m in mentions(page.read_text(encoding="utf-8")) if OURS.match(m)]
    words = [shlex.split(OURS.sub("", m)) for m in found if "COMMAND" not in m and "..." not in m]
    return [
        w for w in words if w and w[-1].startswith("--")
    ]  # the others are names: what they read is left out


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_commands_in_the_middle_of_a_sentence_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    for words in whole_mentions(page):
        run(words)


def others(text: str) -> list[str]:
    """Every line of code, and every command in a sentence, that calls another program than FingerLab."""
    lines = [c.line for c in shell_lines(text) if not c.reason]
    return [line for line in (*lines, *mentions(text)) if not OURS.match(line) or line.startswith("python")]


def unaccounted(line: str) -> str:
    """Why a command of another program is not known to work; empty where it is."""
    for start, (file, words) in RUN_ELSEWHERE.items():
        if line == start or line.startswith(f"{start} "):
            there = (ROOT / file).read_text(encoding="utf-8")
            return "" if words in there else f"{file} does not hold {words!r}"
    called = re.match(r"python (?:-m )?([\w./]+)(.*)", line)
    if called is None or not called[1].startswith(TAKES_HOURS):
        return f"nothing runs '{line}'"
    name = called[1] if called[1].endswith(".py") else called[1].replace(".", "/")
    places = [ROOT / name, ROOT / f"{name}.py", ROOT / name / "__main__.py"]
    source = "".join(p.read_text(encoding="utf-8") for p in places if p.is_file())
    missing = [o for o in re.findall(r"--[a-z-]+", called[2]) if o not in source]
    return f"{called[1]} has no {missing}" if missing or not source else ""


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_other_line_of_code_is_run_somewhere(page: Path) -> None:
    wrong = [why for line in others(page.read_text(encoding="utf-8")) if (why := unaccounted(line))]
    assert not wrong


def test_what_nothing_runs_is_seen() -> None:
    text = (
        "1. Text.\n\n       python nowhere.py\n\n> `python -m benchmarks.soak --houres 2`\n\n"
        "```\ndiagnose s.h5\n```\n\n    mkdocs build\n"
    )
    lines = others(text)
    assert len(lines) == 4
    assert [line for line in lines if not unaccounted(line)] == ["mkdocs build"]


def test_few_commands_are_left_out_and_each_says_why() -> None:
    left_out = [c for page in PAGES for c in commands(page) if c.reason]
    assert {c.reason for c in left_out} <= NOT_RUN
    assert len(left_out) <= MOST_LEFT_OUT, [c.line for c in left_out]
    assert sum(not c.reason for page in PAGES for c in commands(page)) > 2 * len(left_out)


def test_commands_that_are_left_out_are_understood() -> None:
    """Their options are there and take what is given to them; a metavariable stands for a number."""
    left_out = [c for page in PAGES for c in commands(page) if c.reason not in ("", INSTALLS)]
    assert left_out
    for command in left_out:
        name, *words = ["1" if word == "N" else word for word in command.words]
        found = cli.get_command(click.Context(cli), name)
        assert found is not None, command.line
        found.make_context(name, words)


def test_marks_hold_for_their_block_alone_and_every_kind_of_block_is_seen() -> None:
    text = (
        "Text.\n\n<!-- not run: it takes minutes -->\n\n"
        "    fingerlab replicate    # all\n    fingerlab info a.h5\n\n"
        "More.\n\n    fingerlab fit a.h5\n\n```text\nfingerlab | a table\n```\n\n"
        "- a list\n\n      fingerlab fit b.h5\n\n```console\nfingerlab fit c.h5\n```\n"
    )
    assert list(console_lines(text)) == [
        Console("replicate", "it takes minutes"),
        Console("info a.h5", "it takes minutes"),
        Console("fit a.h5", ""),
        Console("fit b.h5", ""),
        Console("fit c.h5", ""),
    ]

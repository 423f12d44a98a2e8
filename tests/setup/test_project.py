"""The project file and the lock files agree with each other and with the folders."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from .conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
DEPENDENCIES = PROJECT["project"]["dependencies"]
TEST_TOOLS = PROJECT["project"]["optional-dependencies"]["test"]
BACKEND = PROJECT["build-system"]["requires"]

MACHINES = [
    {
        "sys_platform": system,
        "platform_machine": machine,
        "python_version": python,
        "python_full_version": full,
    }
    for system, machine in (
        ("linux", "x86_64"),
        ("linux", "aarch64"),
        ("win32", "AMD64"),
        ("darwin", "arm64"),
        ("darwin", "x86_64"),
    )
    for python, full in (("3.11", "3.11.0"), ("3.12", "3.12.1"), ("3.13", "3.13.0"), ("3.14", "3.14.0"))
]


def locked(name: str) -> list[tuple[Requirement, int]]:
    """The packages of a lock file, each with the number of its hashes."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    entries = re.split(r"\n(?=\S)", re.sub(r"^\s*#.*\n", "", text, flags=re.MULTILINE))
    return [
        (Requirement(entry.split("\\")[0].strip()), len(re.findall(r"--hash=sha256:[0-9a-f]{64}\b", entry)))
        for entry in entries
        if entry.strip()
    ]


@pytest.mark.parametrize(
    ("name", "asked"), [("app", DEPENDENCIES + BACKEND), ("test", DEPENDENCIES + BACKEND + TEST_TOOLS)]
)
def test_lock_holds_what_the_project_asks_for_on_every_machine(name: str, asked: list[str]) -> None:
    entries = [entry for entry, _ in locked(name)]
    for machine in MACHINES:
        here = {
            canonicalize_name(entry.name): str(entry.specifier).removeprefix("==")
            for entry in entries
            if entry.marker is None or entry.marker.evaluate(machine)
        }
        for text in asked:
            wanted = Requirement(text)
            if wanted.marker is None or wanted.marker.evaluate(machine):
                version = here.get(canonicalize_name(wanted.name))
                assert version is not None, f"{text}: run 'python packaging/lock.py'"
                assert wanted.specifier.contains(version), f"{text}: run 'python packaging/lock.py'"


@pytest.mark.parametrize("name", ["app", "test", "bundle"])
def test_every_locked_package_has_one_version_and_hashes(name: str) -> None:
    for entry, hashes in locked(name):
        assert re.fullmatch(r"==[0-9][^,*]*", str(entry.specifier)), entry
        assert hashes > 0, entry
        assert entry.url is None


def test_the_test_lock_holds_the_same_versions_as_the_application_lock() -> None:
    test = {str(entry) for entry, _ in locked("test")}
    assert {str(entry) for entry, _ in locked("app")} <= test


def test_the_bundle_lock_holds_the_bundler_and_no_other_version_of_anything() -> None:
    entries = {canonicalize_name(entry.name): entry for entry, _ in locked("bundle")}
    [asked] = [Requirement(text) for text in PROJECT["project"]["optional-dependencies"]["bundle"]]
    assert asked.specifier.contains(str(entries[asked.name].specifier).removeprefix("=="))
    test = {canonicalize_name(entry.name): entry.specifier for entry, _ in locked("test")}
    assert all(entry.specifier == test[name] for name, entry in entries.items() if name in test)


@pytest.mark.parametrize("name", ["app", "test", "bundle"])
def test_lock_names_no_index_and_no_place_on_a_machine(name: str) -> None:
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    assert not re.search(r"://|^--|^-[a-z] | @ |file:|\.whl", text, flags=re.MULTILINE)


def test_every_folder_of_code_is_installed() -> None:
    names = {
        ".".join((prefix, *path.parent.relative_to(ROOT / top).parts))
        for top, prefix in (
            ("fingerlab", "fingerlab"),
            ("ui", "fingerlab.ui"),
            ("resources", "fingerlab.resources"),
            ("docs", "fingerlab.documents"),
        )
        for path in (ROOT / top).rglob("__init__.py")
    }
    assert set(PROJECT["tool"]["setuptools"]["packages"]) == names


def test_every_folder_with_code_has_its_init_file() -> None:
    folders = {path.parent for top in ("fingerlab", "ui") for path in (ROOT / top).rglob("*.py")}
    assert [folder for folder in folders if not (folder / "__init__.py").exists()] == []


def test_starter_imports_the_standard_library_only() -> None:
    import ast
    import sys

    for path in [ROOT / "start.py", *Path(ROOT / "packaging" / "bootstrap").glob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [str(node.module)]
            for name in names:
                top = name.split(".")[0]
                assert top == "bootstrap" or top in sys.stdlib_module_names, f"{path.name}: {name}"


def test_no_package_of_tests_takes_the_name_of_a_library() -> None:
    """pytest imports such a folder by its own name when it is asked for it, and the library is gone."""
    named = {path.parent.name for path in (ROOT / "tests").glob("*/__init__.py")}
    assert named
    assert not named & set(packages_distributions())


def top_level_names(path: Path) -> list[str]:
    """Names that a file's top level gives a value, a class or a function, as often as it does."""
    import ast

    names = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names += [node.name] * (not node.decorator_list)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names += [one.id for one in targets if isinstance(one, ast.Name)]
    return names


def test_no_file_gives_a_name_two_meanings() -> None:
    """A number of the settings that stood twice had been read as the second by all."""
    twice = {}
    for path in (path for top in ("fingerlab", "ui") for path in (ROOT / top).rglob("*.py")):
        names = top_level_names(path)
        twice[str(path)] = {name for name in names if names.count(name) > 1}
    assert {path: names for path, names in twice.items() if names} == {}

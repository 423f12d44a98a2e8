"""Wheel and sdist, built and opened: one top-level name, everything inside, nothing else."""

from __future__ import annotations

import email
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    import distribution

    wheel, sdist = distribution.build_both(tmp_path_factory.mktemp("dist"))
    return wheel, sdist


def source_files() -> set[str]:
    """Every file of the folders, and every page made from the program, by its place once it is installed."""
    from fingerlab.report.documents import pages as every_page

    found = {f"fingerlab/documents/{page}" for page in every_page()}
    for folder, inside in (
        ("fingerlab", "fingerlab"),
        ("ui", "fingerlab/ui"),
        ("resources", "fingerlab/resources"),
        ("docs", "fingerlab/documents"),
    ):
        for path in (ROOT / folder).rglob("*"):
            pages = (".md", ".png", ".css", ".toml")
            wanted = (
                path.suffix == ".py" or folder == "resources" or (folder == "docs" and path.suffix in pages)
            )
            if path.is_relative_to(ROOT / "docs/images/points"):
                continue  # the window at every size, for those who develop it: 7 MB that no page shows
            if path.is_file() and wanted and "__pycache__" not in path.parts:
                found.add(f"{inside}/{path.relative_to(ROOT / folder).as_posix()}")
    return found


def test_the_wheel_holds_every_file_below_one_name(built: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(built[0]) as wheel:
        names = {name for name in wheel.namelist() if not name.endswith("/")}
        info = f"fingerlab-{PROJECT['version']}.dist-info"
        assert {name.split("/")[0] for name in names} == {"fingerlab", info}
        assert {name for name in names if not name.startswith(info)} == source_files()
        assert wheel.read(f"{info}/top_level.txt").decode().split() == ["fingerlab"]
        assert "fingerlab = fingerlab.cli:main" in wheel.read(f"{info}/entry_points.txt").decode()
        told = email.message_from_bytes(wheel.read(f"{info}/METADATA"))
    assert (told["Name"], told["Version"]) == ("fingerlab", PROJECT["version"])
    asked = {re.split(r"[<>=;\[ ]", text)[0].lower() for text in told.get_all("Requires-Dist", [])}
    assert {"numpy", "scipy", "h5py", "pyside6-essentials", "xarray"} <= asked


def test_the_sdist_makes_the_same_wheel(built: tuple[Path, Path], tmp_path: Path) -> None:
    import distribution

    with tarfile.open(built[1]) as archive:
        archive.extractall(tmp_path, filter="data")
    source = tmp_path / f"fingerlab-{PROJECT['version']}"
    assert (source / "CHANGELOG.md").is_file()
    again = distribution.build("wheel", source, tmp_path / "again")
    with zipfile.ZipFile(built[0]) as ours, zipfile.ZipFile(again) as theirs:
        contents = [
            {i.filename: i.CRC for i in w.infolist() if "RECORD" not in i.filename} for w in (ours, theirs)
        ]
    assert contents[0] == contents[1]


def test_the_wheel_starts_without_the_checkout(built: tuple[Path, Path], tmp_path: Path) -> None:
    """Unpacked, which is all that installing plain Python does, and before the checkout in the path."""
    with zipfile.ZipFile(built[0]) as wheel:
        wheel.extractall(tmp_path / "site")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r})\n"
        "import fingerlab, fingerlab.ui.app.tab_registry\n"
        "from importlib.resources import files\n"
        "print(fingerlab.__file__, fingerlab.ui.__file__, files('fingerlab.resources') / 'rigs')\n"
        "assert (files('fingerlab.resources') / 'rigs' / 'default.toml').is_file()\n"
        "from fingerlab.report.documents import folder, glossary, pages\n"
        "assert folder().name == 'documents' and 'floor' in glossary()\n"
        "assert '--8<--' not in (folder() / 'own-effect.md').read_text(encoding='utf-8')\n"
        "assert {'theory.md', 'tutorials/model-lab.md', 'catalogue/cable_slack.md'} <= set(pages())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for place in done.stdout.split():
        assert Path(place).is_relative_to(tmp_path / "site")


def test_a_failed_build_says_why(tmp_path: Path) -> None:
    import distribution

    (tmp_path / "pyproject.toml").write_text("[project]\nname = 'a b c'\nversion = '1'\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match="wheel could not be built"):
        distribution.build("wheel", tmp_path, tmp_path / "dist")


def test_versions_agree() -> None:
    import fingerlab

    assert fingerlab.__version__ == PROJECT["version"]
    cite = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {PROJECT['version']}\n" in cite
    assert f"({PROJECT['version']})" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_licence_is_the_same_everywhere_and_comes_with_both_packages(built: tuple[Path, Path]) -> None:
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    name = PROJECT["license"]
    assert text.splitlines()[0].replace(" ", "-").removesuffix("-License") == name
    assert "Copyright (c)" in text
    assert f"\nlicense: {name}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    for page in ("README.md", "docs/contributing.md", "packaging/LICENCES.md"):
        assert text.splitlines()[0] in " ".join((ROOT / page).read_text(encoding="utf-8").split()), page
    info = f"fingerlab-{PROJECT['version']}"
    with zipfile.ZipFile(built[0]) as wheel:
        told = email.message_from_bytes(wheel.read(f"{info}.dist-info/METADATA"))
        assert (told["License-Expression"], told["License-File"]) == (name, "LICENSE")
        assert wheel.read(f"{info}.dist-info/licenses/LICENSE").decode() == text
    with tarfile.open(built[1]) as sdist:
        assert f"{info}/LICENSE" in sdist.getnames()

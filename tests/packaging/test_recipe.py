"""PyInstaller's recipe, read as it is on each system; PyInstaller itself is played."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
RECIPE = ROOT / "packaging" / "fingerlab.spec"


class Told:
    """What one of PyInstaller's classes is told; ``Analysis`` has found two libraries."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        self.arguments, self.keywords = arguments, keywords
        self.binaries = [("libgtk-3.so.0", "", "BINARY"), ("hdf5.dll", "", "BINARY")]
        self.datas = [(inside, source, "DATA") for source, inside in keywords.get("datas", ())]
        self.pure: list[Any] = []
        self.scripts: list[Any] = []


def recipe(system: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The recipe's own names after it was read on ``system``."""
    import icons

    hooks = ModuleType("PyInstaller.utils.hooks")
    for name, found in (
        ("collect_submodules", ["fingerlab.cli.main"]),
        ("collect_data_files", [("default.toml", "fingerlab/resources/rigs")]),
    ):
        setattr(hooks, name, lambda _package, found=found: found)
    hooks.copy_metadata = lambda package: [("METADATA", f"{package}.dist-info")]  # type: ignore[attr-defined]
    for name in ("PyInstaller", "PyInstaller.utils"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, "PyInstaller.utils.hooks", hooks)
    drawn = {kind: folder / f"fingerlab.{kind}" for kind in ("png", "ico", "icns")}
    monkeypatch.setattr(icons, "make_icons", lambda _folder: drawn)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "platform", system)
    names: dict[str, Any] = {"SPECPATH": str(RECIPE.parent), "workpath": str(folder)}
    names |= dict.fromkeys(("Analysis", "PYZ", "EXE", "COLLECT"), Told)
    names["BUNDLE"] = lambda *arguments, **keywords: names.update(app=Told(*arguments, **keywords))
    exec(compile(RECIPE.read_text(encoding="utf-8"), RECIPE, "exec"), names)
    return names


@pytest.mark.parametrize("system", ["linux", "win32", "darwin"])
def test_the_recipe_makes_a_program_for_each_system(
    system: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = recipe(system, tmp_path, monkeypatch)
    analysis, told = read["analysis"], read["program"].keywords
    assert [Path(name) for name in analysis.arguments[0]] == [ROOT / "packaging" / "entry.py"]
    assert analysis.keywords["hiddenimports"][0] == "fingerlab.cli.main"
    assert {"tkinter", "pytest"} <= set(analysis.keywords["excludes"])
    assert [name for name, _, _ in analysis.binaries] == ["hdf5.dll"]  # ballast is left out
    places = {inside for inside, _, _ in analysis.datas}
    assert {"fingerlab/resources/rigs", "licences"} <= places
    # These ask for their own version while they are imported.
    assert {"fingerlab.dist-info", "nidaqmx.dist-info", "nitypes.dist-info"} <= places
    assert not {"pytest.dist-info", "nowhere.dist-info"} & places
    # A program that prints, without a terminal of its own where a double click would open one.
    assert (told["console"], told["hide_console"]) == (True, "hide-early" if system == "win32" else None)
    icon = {"linux": None, "win32": "fingerlab.ico", "darwin": "fingerlab.icns"}[system]
    assert (Path(told["icon"]).name if told["icon"] else None) == icon
    assert ("share/applications" in places) == (system == "linux")
    assert (told["version"] is not None) == (system == "win32")
    if system == "win32":
        assert "VSVersionInfo" in Path(told["version"]).read_text(encoding="utf-8")
    assert ("app" in read) == (system == "darwin")
    if system == "darwin":
        app = read["app"]
        assert app.arguments[0] is read["folder"]
        assert (app.keywords["name"], Path(app.keywords["icon"]).name) == ("FingerLab.app", icon)

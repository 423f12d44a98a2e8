"""What the packaged program is made of, apart from PyInstaller: icons, version, licences, first words."""

from __future__ import annotations

import configparser
import importlib.util
import struct
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGING = ROOT / "packaging"


def test_icons_hold_every_size_that_desktops_ask_for(tmp_path: Path) -> None:
    """Read by the formats' own headers: ICONDIR and ICONDIRENTRY; icns types and lengths; PNG's IHDR."""
    done = subprocess.run(
        [sys.executable, str(PACKAGING / "icons.py"), str(tmp_path)], capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
    png = (tmp_path / "fingerlab.png").read_bytes()
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", png[16:24]) == (256, 256)
    ico = (tmp_path / "fingerlab.ico").read_bytes()
    reserved, kind, count = struct.unpack("<HHH", ico[:6])
    assert (reserved, kind, count) == (0, 1, 7)
    widths = {ico[6 + 16 * i] or 256 for i in range(count)}  # 0 stands for 256
    assert widths == {16, 24, 32, 48, 64, 128, 256}
    icns = (tmp_path / "fingerlab.icns").read_bytes()
    assert icns[:4] == b"icns"
    assert struct.unpack(">I", icns[4:8])[0] == len(icns)
    types, at = set(), 8
    while at < len(icns):
        types.add(icns[at : at + 4])
        at += struct.unpack(">I", icns[at + 4 : at + 8])[0]
    assert {b"ic07", b"ic08", b"ic09", b"ic10"} <= types  # 128, 256, 512 and 1024 pixels
    _assert_drawn(tmp_path / "fingerlab.png")


def _assert_drawn(path: Path) -> None:
    """The drawing's own colours are in the picture: ground, finger and cable; its corners are clear."""
    from PIL import Image

    image = Image.open(path).convert("RGBA")
    colours = {colour[:3] for _, colour in image.getcolors(256 * 256) or []}
    assert {(0x24, 0x42, 0x5C), (0xF4, 0xF6, 0xF8), (0xE6, 0x9F, 0x00)} <= colours
    assert image.getpixel((0, 0))[3] == 0  # type: ignore[index]


def test_the_version_resource_reads_as_windows_wants_it() -> None:
    """Evaluated with stand-ins for PyInstaller's classes, which take what is written."""
    import bundling

    given: dict[str, object] = {}

    def note(name: str):  # type: ignore[no-untyped-def]
        def take(*args: object, **keywords: object) -> tuple[object, ...]:
            given.setdefault(name, keywords or args)
            return (name, args, keywords)

        return take

    names = (
        "VSVersionInfo",
        "FixedFileInfo",
        "StringFileInfo",
        "StringTable",
        "StringStruct",
        "VarFileInfo",
        "VarStruct",
    )
    eval(bundling.windows_version("1.2.3"), {name: note(name) for name in names})
    fixed = given["FixedFileInfo"]
    assert isinstance(fixed, dict)
    assert fixed["filevers"] == fixed["prodvers"] == (1, 2, 3, 0)
    assert given["VarStruct"] == ("Translation", [1033, 1200])  # US English in Unicode


def test_the_desktop_entry_has_what_menus_need() -> None:
    entry = configparser.ConfigParser(interpolation=None)
    entry.optionxform = str  # type: ignore[assignment, method-assign]
    entry.read(PACKAGING / "linux" / "fingerlab.desktop", encoding="utf-8")
    [group] = entry.sections()
    assert group == "Desktop Entry"
    told = dict(entry[group])
    assert {"Type", "Name", "Exec", "Icon", "Categories"} <= set(told)
    assert told["Type"] == "Application"
    assert told["Exec"].split() == ["FingerLab", "%F"]


def test_tools_of_the_tests_stay_out_and_the_program_s_own_stay_in() -> None:
    import bundling

    out = set(bundling.left_out())
    assert {"pytest", "mypy", "mujoco", "mkdocs", "xarray", "tkinter"} <= out
    assert not out & {
        "numpy",
        "scipy",
        "h5py",
        "PySide6",
        "shiboken6",
        "matplotlib",
        "numba",
        "click",
        "rich",
    }


def test_ballast_goes_and_what_the_program_opens_stays() -> None:
    import bundling

    kept = (
        "pyarrow/libarrow.so.2600",
        "pyarrow/libarrow_substrait.so.2600",
        "pyarrow/_parquet.cpython-311-x86_64-linux-gnu.so",
        "PySide6/Qt/lib/libQt6Widgets.so.6",
        "PySide6/Qt/plugins/platforms/libqoffscreen.so",
        "libcairo-gobject-of-someone-else.so",
        "numpy/_core/tests_of_speed.so",
    )
    gone = (
        "pyarrow/include/arrow/api.h",
        "pyarrow\\include\\arrow\\api.h",
        "pyarrow/libarrow_s3.so.2600",
        "pyarrow/arrow_flight.dll",
        "libarrow_python_flight.so.2600",
        "libgtk-3.so.0",
        "libcairo.so.2",
        "PySide6/Qt/plugins/platformthemes/libqgtk3.so",
        "scipy/io/matlab/tests/data.mat",
    )
    left = bundling.without_ballast([(name, "", "DATA") for name in (*kept, *gone)])
    assert [name for name, _, _ in left] == list(kept)


def test_licence_texts_are_found_for_what_is_bundled() -> None:
    import bundling
    import licences

    files = bundling.licence_files()
    places = [(folder, Path(path).name) for path, folder in files]
    assert len(places) == len(set(places))  # none hides another
    assert ("licences", "LGPL-3.0.txt") in places
    named = {Path(folder).parts[1] for folder, _ in places if len(Path(folder).parts) > 1}
    without = set(licences.locked("app")) - named
    assert {"numpy", "scipy", "h5py", "pyarrow", "python"} <= named
    # Those that bring no text have one in packaging/texts; pywin32 is not installed off Windows.
    assert without - set(licences.ELSEWHERE) == set(licences.BROUGHT)
    assert {("licences", text) for text in licences.BROUGHT.values()} <= set(places)


@pytest.fixture
def entry():  # type: ignore[no-untyped-def]
    spec = importlib.util.spec_from_file_location("packaged_entry", PACKAGING / "entry.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_files_open_the_window_and_words_are_commands(entry, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    session = tmp_path / "a session.H5"
    session.touch()
    assert entry.are_sessions([str(session)])
    assert not entry.are_sessions([])
    assert not entry.are_sessions(["info", str(session)])
    assert not entry.are_sessions([str(tmp_path / "absent.h5")])


def test_the_self_check_wants_a_session(entry, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    assert entry.begin(["--self-check", "absent.h5"]) == 2
    assert "needs one session file" in capsys.readouterr().err


def test_the_self_check_ends_with_the_sentence_that_the_window_shows(tmp_path: Path) -> None:
    bad = tmp_path / "bad.h5"
    bad.write_text("no session", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "fingerlab.ui.self_check", str(bad)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=240,
        check=False,
    )
    assert done.returncode == 1
    assert f"fingerlab: {bad}" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_self_check_misses_what_drives_the_card(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from fingerlab.ui import self_check

    monkeypatch.setitem(sys.modules, "nidaqmx.system", None)  # as if a part of it had not been packed
    (tmp_path / "any.h5").touch()
    assert self_check.main([str(tmp_path / "any.h5")]) == 1
    assert "nidaqmx.system, which drives the card, cannot be loaded" in capsys.readouterr().err


def test_a_packaged_program_that_fails_or_hangs_is_told(tmp_path: Path) -> None:
    import bundle

    bare = bundle.bare_environment(tmp_path)
    with pytest.raises(bundle.BundleError, match="ended with 3:\nbecause"):
        bundle.call([sys.executable, "-c", "print('because'); raise SystemExit(3)"], tmp_path, bare)
    assert not [name for name in bare if name.startswith("PYTHON")]
    assert bare["QT_QPA_PLATFORM"] == "offscreen"

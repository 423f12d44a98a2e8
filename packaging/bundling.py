"""What ``fingerlab.spec`` asks: what goes into a packaged program beside the code, and what stays out."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path

import licences

ROOT = Path(__file__).resolve().parents[1]
PACKAGING = ROOT / "packaging"

Entry = tuple[str, str, str]
"""Of PyInstaller's lists: place in the program's folder, file that it comes from, kind."""

UNUSED = (
    # Qt's own modelling language and what only it needs: the window is made of widgets.
    *(f"PySide6.Qt{name}" for name in ("Qml", "Quick", "QuickWidgets", "QuickControls2", "Designer", "Help")),
    *("PySide6.QtSql", "PySide6.QtTest", "PySide6.QtUiTools"),
    *("tkinter", "IPython", "pip", "setuptools", "_distutils_hack", "pkg_resources"),
    *("matplotlib.tests", "numba.tests", "numba.cuda", "pydoc_data"),
    *(f"pyqtgraph.{name}" for name in ("examples", "opengl", "jupyter", "canvas", "flowchart")),
    # Parts of Arrow that a table on disk does not need: its network service and object stores.
    *(f"pyarrow.{name}" for name in ("_flight", "flight", "tests", "_s3fs", "_gcsfs", "_azurefs")),
)
BALLAST = (
    r"pyarrow/(include|src|tests)/",
    r"pyarrow/.*\.(pxd|pxi|pyx|h|cpp)$",
    r"arrow_((python_)?flight|s3)\.",  # its other libraries all need each other
    r"PySide6/(Qt/)?(qml|translations)/",
    r"Qt6?(Qml|Quick|VirtualKeyboard|Pdf|EglFS)|egldeviceintegrations",
    # The GTK look, which the window does not use, and the thirty system libraries that it draws in.
    r"libqgtk3|^lib(gtk-3|gdk-3|gdk_pixbuf-2\.0|atk-1\.0|atk-bridge-2\.0|atspi|epoxy|thai|datrie|fribidi)\.so",
    r"^lib(pango|pangocairo|pangoft2|cairo|cairo-gobject)(-1\.0)?\.so|^lib(pixman-1|harfbuzz|graphite2)\.so",
    r"matplotlib/mpl-data/(sample_data|plot_directive)/",
    r"(numpy|scipy|numba|llvmlite)/.*/tests/",
)
"""Files that the packages' recipes bring and that nothing here opens."""


def left_out() -> list[str]:
    """Modules that must not be collected: the unused, and all that only the tests' environment has."""
    app = {_canonical(name) for name in licences.locked("app")}
    tests_only = {_canonical(name) for name in licences.locked("test")} - app
    only: list[str] = []
    for module, packages in metadata.packages_distributions().items():
        owners = {_canonical(p) for p in packages}
        if owners and owners <= tests_only and module.isidentifier():
            only.append(module)
    return [*UNUSED, *sorted(only)]


def _canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def without_ballast(entries: Iterable[Entry]) -> list[Entry]:
    """The entries of a list that the program needs."""
    pattern = re.compile("|".join(BALLAST))
    return [one for one in entries if not pattern.search(one[0].replace("\\", "/"))]


def metadata_files(copy: Callable[[str], list[tuple[str, str]]]) -> list[tuple[str, str]]:
    """What each package says of itself (``*.dist-info``): file and folder, for ``datas``.

    Some, such as nidaqmx, ask for their own version while they are imported and fail without.

    Args:
        copy: PyInstaller's ``copy_metadata``.
    """
    present = {_canonical(one.name) for one in metadata.distributions()}
    return [entry for name in licences.locked("app") if _canonical(name) in present for entry in copy(name)]


def licence_files() -> list[tuple[str, str]]:
    """The list of what is bundled, and each package's own licence texts: file and folder, for ``datas``."""
    found = [(str(PACKAGING / "LICENCES.md"), "licences")]
    found += [(str(path), "licences") for path in sorted((PACKAGING / "texts").glob("*.txt"))]
    python = [Path(sys.base_prefix) / "LICENSE.txt", Path(metadata.__file__).parents[2] / "LICENSE.txt"]
    found += [(str(path), "licences/python") for path in python if path.is_file()][:1]
    if (ROOT / "LICENSE").is_file():
        found.append((str(ROOT / "LICENSE"), "."))
    for name in licences.locked("app"):
        # Some packages bring several of one name, each in a folder of its own.
        found += [
            (str(path), str(Path("licences", name, inside).parent)) for inside, path in licences.texts(name)
        ]
    return found


def desktop_files(icons: Mapping[str, Path]) -> list[tuple[str, str]]:
    """Entry and icon for the menu of a Linux desktop; nothing on other systems."""
    if not sys.platform.startswith("linux"):
        return []
    return [
        (str(PACKAGING / "linux" / "fingerlab.desktop"), "share/applications"),
        (str(icons["png"]), "share/icons/hicolor/256x256/apps"),
        (str(ROOT / "resources" / "icon" / "fingerlab.svg"), "share/icons/hicolor/scalable/apps"),
    ]


def system_library_list(binaries: Iterable[Entry], work: Path) -> list[Entry]:
    """Libraries of this Linux that go into the program, with the Debian package of each, as a file."""
    if not sys.platform.startswith("linux"):
        return []
    outside = sorted({src for _, src, _ in binaries if src.startswith(("/usr/lib/", "/lib/"))})
    owners = _debian_packages(outside)
    lines = [f"{Path(path).name}  {owners.get(path, '')}".rstrip() for path in outside]
    head = "Shared libraries of the system that built this program; /usr/share/doc/PACKAGE/copyright there\n"
    target = work / "system-libraries.txt"
    target.write_text(head + "has the terms of each.\n\n" + "\n".join(lines) + "\n", encoding="utf-8")
    found: list[Entry] = [("licences/system-libraries.txt", str(target), "DATA")]
    for package in sorted(set(owners.values())):
        terms = Path("/usr/share/doc") / package / "copyright"
        if terms.is_file():
            found.append((f"licences/system/{package}.txt", str(terms.resolve()), "DATA"))
    return found


def _debian_packages(paths: Sequence[str]) -> dict[str, str]:
    """The installed Debian package of each file, where there is one; asked once, for it takes a while."""
    if not paths or shutil.which("dpkg-query") is None:
        return {}
    # The package may know the file under /lib or /usr/lib, by its link or by what the link points to.
    names = {
        name: path
        for path in paths
        for real in (path, str(Path(path).resolve()))
        for name in (real, real.removeprefix("/usr"), f"/usr{real}")
    }
    asked = subprocess.run(["dpkg-query", "-S", *names], capture_output=True, text=True, check=False)
    owners = {}
    for line in asked.stdout.splitlines():
        package, _, name = line.partition(": ")
        if name in names:
            owners[names[name]] = package.split(":")[0].split(",")[0]
    return owners


def windows_version(version: str) -> str:
    """Version resource of the Windows program, as PyInstaller reads it (four numbers and strings)."""
    numbers = tuple(int(part) for part in re.findall(r"\d+", version)[:4])
    four = (*numbers, 0, 0, 0, 0)[:4]
    strings = {
        "CompanyName": "FingerLab",
        "FileDescription": "FingerLab",
        "FileVersion": version,
        "InternalName": "FingerLab",
        "OriginalFilename": "FingerLab.exe",
        "ProductName": "FingerLab",
        "ProductVersion": version,
    }
    table = ",\n      ".join(f"StringStruct({name!r}, {value!r})" for name, value in strings.items())
    return (
        "VSVersionInfo(\n"
        f"  ffi=FixedFileInfo(filevers={four}, prodvers={four}, mask=0x3F, flags=0x0, OS=0x40004,\n"
        "    fileType=0x1, subtype=0x0, date=(0, 0)),\n"
        "  kids=[\n"
        f"    StringFileInfo([StringTable('040904B0', [\n      {table}])]),\n"
        "    VarFileInfo([VarStruct('Translation', [1033, 1200])])])\n"
    )

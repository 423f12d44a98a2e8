"""List the licences of what a packaged program bundles: ``python packaging/licences.py`` in ``.venv``.

Writes ``packaging/LICENCES.md`` from ``requirements/app.txt`` and what each installed package says of itself.
"""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "packaging" / "LICENCES.md"
ELSEWHERE = {"pywin32": ("312", "PSF-2.0 (Windows only; from its page, not installed here)")}
"""Packages of other systems, which this machine cannot ask."""
BROUGHT = {
    "pyside6-essentials": "LGPL-3.0.txt",
    "shiboken6": "LGPL-3.0.txt",
    "ni-grpcdevice-v1-proto": "MIT-NI.txt",
    "ni-protobuf-types": "MIT-NI.txt",
}
"""Packages that bring no text of their licence -> the file of ``packaging/texts`` that holds it."""
TEXT_NAMES = re.compile(r"licen[cs]e|copying|notice|authors", re.IGNORECASE)
"""Files of a ``*.dist-info`` folder that tell the terms of the package."""
HEAD = """# What a packaged program bundles

Made by `python packaging/licences.py` from `requirements/app.txt` and what each package says of itself; the
full texts lie in each package's own folder (`*.dist-info`). Besides these: Python itself (PSF-2.0), and what
starts it, PyInstaller's (GPL-2.0 with an exception that leaves what it starts under its own terms). Qt comes
with PySide6 under LGPL-3.0: it is bundled as shared libraries, which a user may replace. FingerLab itself is
under the BSD 3-Clause License (`LICENSE`).

| package | version | licence |
|---|---|---|
"""


def locked(tools: str = "app") -> list[str]:
    """Names of the packages of a lock file (the application's by default), each once."""
    text = (ROOT / "requirements" / f"{tools}.txt").read_text(encoding="utf-8")
    return sorted(set(re.findall(r"^([A-Za-z0-9_.-]+)==", text, re.MULTILINE)))


def licence(name: str) -> tuple[str, str]:
    """Version and licence of an installed package, as short as it says them."""
    if name in ELSEWHERE:
        return ELSEWHERE[name]
    about = metadata.metadata(name).json
    listed = [str(k) for k in about.get("classifier", [])]
    kinds = [k.split("::")[-1].strip() for k in listed if k.startswith("License ::")]
    said = about.get("license_expression") or ", ".join(kinds) or str(about.get("license", "")).split("\n")[0]
    return str(about["version"]), str(said)


def texts(name: str) -> list[tuple[Path, Path]]:
    """Licence texts that an installed package brings: path inside its ``*.dist-info``, and the file.

    Empty where the package is not installed or brings none.
    """
    try:
        files = metadata.files(name) or []
    except metadata.PackageNotFoundError:
        return []
    found = [f for f in files if ".dist-info" in str(f) and TEXT_NAMES.search(f.name)]
    pairs = [(Path(*f.parts[1:]), Path(str(f.locate()))) for f in found]
    return [(inside, path) for inside, path in pairs if path.is_file()]


def main() -> int:
    """Write the list; 1 where a package says nothing."""
    rows = [(name, *licence(name)) for name in locked()]
    TARGET.write_text(HEAD + "".join(f"| {n} | {v} | {said} |\n" for n, v, said in rows), encoding="utf-8")
    silent = [name for name, _, said in rows if not said]
    if silent:
        print(f"licences.py: no licence stated by {', '.join(silent)}", file=sys.stderr)
    return 1 if silent else 0


if __name__ == "__main__":
    sys.exit(main())

"""A report as text and hashes: what it says line by line, and of each figure its words and what is drawn."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

from tests.goldens.calling import words

_SVG = re.compile(r"<svg\b.*?</svg>", re.DOTALL)
_ID = re.compile(r'<svg\b[^>]*?\bid="([^"]+)"')
_TEXT = re.compile(r"(?<=>)([^<>]+)(?=<)")
_STYLE = re.compile(r"<style\b.*?</style>", re.DOTALL)
_METADATA = re.compile(r"<metadata>.*?</metadata>", re.DOTALL)
_BULK = re.compile(
    r"(?<=<style>).*?(?=</style>)|(?<=<script>).*?(?=</script>)|(?<=base64,)[\w+/=]+", re.DOTALL
)


def page(html: str, folder: Path) -> dict[str, Any]:
    """The page's lines, styles and fonts as hashes, and its figures by id."""
    figures = {}
    for number, drawn in enumerate(_SVG.findall(html)):
        name = _ID.search(drawn)
        figures[name[1] if name else f"figure {number}"] = _figure(words(drawn, [folder]))
    text = _BULK.sub(lambda found: _hash(found[0]), _SVG.sub("<figure/>", html))
    lines = [line.strip() for line in words(text, [folder]).splitlines()]
    return {"figures": figures, "lines": [line for line in lines if line]}


def _figure(svg: str) -> dict[str, Any]:
    drawn = _METADATA.sub("", svg)
    said = [text.strip() for text in _TEXT.findall(_STYLE.sub("", drawn))]
    return {"words": [text for text in said if text], "drawn": _hash(_TEXT.sub("", drawn))}


def paper(path: Path, folder: Path) -> list[list[str]]:
    """The sentences of each page of a PDF; where lines break does not matter."""
    from pypdf import PdfReader

    pages = [" ".join(one.extract_text().split()) for one in PdfReader(path).pages]
    return [re.split(r"(?<=\.) ", words(text, [folder])) for text in pages]


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:20]

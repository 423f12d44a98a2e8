"""The documents as the program has them: pages of Markdown, and the words of the glossary. No Qt.

A wheel and the packaged program hold every page; in a checkout those that are made from the program itself
are made when they are first asked for.
"""

from __future__ import annotations

import posixpath
import re
import sys
from collections.abc import Iterator
from functools import lru_cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import fingerlab
from fingerlab.core.errors import UserError

FIRST, GLOSSARY = "index.md", "glossary.md"
EVERYDAY = ("base", "bench", "path", "set", "signal", "turn")
"""Words of the glossary that stand in the window in their everyday meaning, too."""

_LINK = re.compile(r"\]\(([^)\s#]+\.md)(?:#[^)\s]*)?\)")
_ASIDE = re.compile(r"<!--.*?-->\n?", re.DOTALL)
_SNIPPET = re.compile(r'^--8<-- "([\w.]+)"$', re.MULTILINE)
_NOTE = re.compile(r'^!!! (\w+)(?: "(.*)")?\n((?:(?: {4}.*)?\n)+)', re.MULTILINE)
_FORMULA = re.compile(
    r"```.*?```|`[^`\n]*`|^ {4}.*?$|\$\$(?P<block>.+?)\$\$|\$(?P<inline>[^$\n]+?)\$", re.DOTALL | re.MULTILINE
)
_TYPED = (
    (r"\\(?:begin|end)\{[a-z]+\*?\}|&", ""),
    (r"\\t?frac(\d)(\d)", r"\\frac{\1}{\2}"),
    (r"\\tfrac", r"\\frac"),
    (r"\\([gl])e\b", r"\\\1eq"),
    (r"\\(hat|bar|dot|ddot|tilde) (\w)", r"\\\1{\2}"),
)


def folder() -> Path:
    """Where the pages are: inside the installed program, or the checkout's own ``docs``."""
    package = Path(fingerlab.__file__).parent
    installed = package / "documents"
    return installed if installed.is_dir() else package.parent / "docs"


@lru_cache(maxsize=1)
def pages() -> dict[str, str]:
    """Markdown of every page by its path, from the first one on as their links lead.

    Snippets stand in their place; comments are gone, notes are quotations.

    Raises:
        UserError: this installation holds no documents.
    """
    place = folder()
    found = {path.relative_to(place).as_posix(): path for path in sorted(place.rglob("*.md"))}
    if FIRST not in found:
        raise UserError(f"There are no documents in {place}; install FingerLab again to have them.")
    texts = {name: path.read_text(encoding="utf-8") for name, path in found.items()}
    if "commands.md" not in texts:
        spec = spec_from_file_location("fingerlab_generated_pages", place / "generate.py")
        if spec is None or spec.loader is None:
            raise UserError(
                f"There is no generate.py in {place}; install FingerLab again to have all documents."
            )
        maker = module_from_spec(spec)  # makes the pages that a checkout does not hold
        sys.modules[spec.name] = maker
        spec.loader.exec_module(maker)
        texts = {name: maker.on_page_markdown(text) for name, text in texts.items()} | maker.pages()
    order = dict.fromkeys([*_linked(texts, FIRST), *texts])
    return {name: _as_read(texts[name], place) for name in order}


def _linked(texts: dict[str, str], first: str) -> Iterator[str]:
    """Pages as their links lead, breadth first."""
    waiting, seen = [first], {first}
    while waiting:
        name = waiting.pop(0)
        yield name
        for link in _LINK.findall(texts[name]):
            target = resolved(name, link)
            if target in texts and target not in seen:
                seen.add(target)
                waiting.append(target)


def resolved(page: str, link: str) -> str:
    """A link of a page as a path below the folder."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(page), link))


def _as_read(text: str, place: Path) -> str:
    text = _ASIDE.sub("", text)
    text = _SNIPPET.sub(lambda found: (place / found[1]).read_text(encoding="utf-8").rstrip(), text)
    return _NOTE.sub(_quoted, text.replace("``` {.python}", "```python").replace("```{.python}", "```python"))


def _quoted(found: re.Match[str]) -> str:
    title = found[2] or found[1].capitalize()
    lines = [line.strip() for line in found[3].strip().splitlines()]
    return "\n".join([f"> **{title}.**", *(f"> {line}".rstrip() for line in lines)]) + "\n\n"


def title_of(text: str) -> str:
    """A page's title: its first heading."""
    found = re.search(r"^# (.+)$", text, re.MULTILINE)
    return found[1].strip() if found else "Untitled"


def slug(heading: str) -> str:
    """The anchor of a heading, as in links between the pages."""
    return re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", heading.strip().lower()))


def with_formulas(text: str) -> tuple[str, list[str]]:
    """The page with an image ``formula:NUMBER`` for each formula, and their LaTeX as mathtext draws it.

    A formula of several lines is an image each; code keeps its dollars.
    """
    formulas: list[str] = []

    def image(found: re.Match[str]) -> str:
        latex = found["block"] or found["inline"]
        if not latex:
            return found[0]
        made = []
        for line in re.split(r"\\\\(?=\s)", latex.replace("\n", " ")):
            for pattern, by in _TYPED:
                line = re.sub(pattern, by, line)
            made.append(f"![formula](formula:{len(formulas)})")
            formulas.append(line.strip())
        return "\n\n" + "\n\n".join(made) + "\n\n" if found["block"] else made[0]

    return _FORMULA.sub(image, text), formulas


@lru_cache(maxsize=1)
def glossary() -> dict[str, tuple[str, str]]:
    """Each word of the glossary -> its entry, such as ``session, run``, and what that means."""
    try:
        text = (folder() / GLOSSARY).read_text(encoding="utf-8")
    except OSError:
        return {}
    entries = [
        (_plain(re.sub(r" \(.*?\)", "", words)), _plain(said))
        for words, said in re.findall(r"^\| (.+?) \| (.+?) \|$", text, re.MULTILINE)
    ]
    return {word: entry for entry in entries for word in entry[0].split(", ") if entry[0] != "word"}


def meaning(word: str) -> str:
    """``Floor: how well ...``: a word of the glossary as a sentence; the word alone where it is not known."""
    known = glossary().get(word)
    return f"{word[:1].upper()}{word[1:]}{f': {known[1]}' if known else ''}."


def words_in(text: str) -> dict[str, tuple[str, str]]:
    """The glossary's words that a text uses and does not explain itself, as they come, with their entries."""
    known = {
        word.lower(): word
        for word, (_, said) in glossary().items()
        if word not in EVERYDAY and said not in text
    }
    if not known:
        return {}
    longest = sorted(known, key=len, reverse=True)
    found = re.findall(rf"\b({'|'.join(map(re.escape, longest))})(?:s|es)?\b", text.lower().replace("-", " "))
    entries = {glossary()[known[word]]: known[word] for word in reversed(found)}
    return {word: entry for entry, word in reversed(entries.items())}


def _plain(markdown: str) -> str:
    """Without the marks of Markdown."""
    text = re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", markdown)
    return re.sub(r"[`*]", "", text).strip().rstrip(".")

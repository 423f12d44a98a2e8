"""The documents: every command in them parses, every link leads somewhere, made pages tell the code."""

from __future__ import annotations

import importlib.util
import math
import re
import shlex
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import click
import numpy as np
import pytest
from PIL import Image

from fingerlab.cli.main import COMMANDS, cli
from fingerlab.devices.protocol import Device
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from tests.docs.console import OURS, console_lines, mentions

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
WRITTEN = (
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "packaging/README.md")),
    *sorted(DOCS.rglob("*.md")),
)
PLACEHOLDERS = {"N": "1", "ID": "coulomb_friction", "THAT_FOLDER": "folder", "FILE": "file.json"}


def load(name: str, folder: Path = DOCS) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"documents_{name}", folder / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def generate() -> ModuleType:
    return load("generate")


@pytest.fixture(scope="module")
def pages(generate: ModuleType) -> dict[str, str]:
    made = generate.pages()
    assert isinstance(made, dict)
    return made


def parsed(line: str, whole: bool) -> None:
    """Let the command's own parser read ``line``.

    Raises:
        click.ClickException: the parser refuses it.
    """
    words = [PLACEHOLDERS.get(word, word) for word in shlex.split(line) if word != "..."]
    if not words or words[0] == "--help":
        return
    command = cli.get_command(click.Context(cli), words[0])
    if command is None:
        raise click.UsageError(f"there is no command {words[0]}")
    if not whole or "--help" in words:
        options = {o for p in command.params for o in (*p.opts, *p.secondary_opts)} | {"--help"}
        unknown = [w for w in words if w.startswith("--") and w.split("=")[0] not in options]
        if unknown:
            raise click.NoSuchOption(unknown[0])
        return
    command.make_context(words[0], words[1:]).close()


@pytest.mark.parametrize("page", WRITTEN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_command_in_the_documents_parses(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for line in (command.line for command in console_lines(text)):
        if line.split()[0] in ("COMMAND", "test"):
            continue
        try:
            parsed(line, whole=True)
        except click.ClickException as error:
            pytest.fail(f"{page.name}: 'fingerlab {line}': {error.format_message()}")
    for line in (OURS.sub("", m).strip() for m in mentions(text) if OURS.match(m)):
        if not line or line.split()[0] in ("COMMAND", "test"):
            continue
        try:
            parsed(line, whole=False)
        except click.ClickException as error:
            pytest.fail(f"{page.name}: 'fingerlab {line}': {error.format_message()}")


def test_the_check_of_commands_sees_them_and_refuses_wrong_ones() -> None:
    text = (DOCS / "quick-start.md").read_text(encoding="utf-8")
    assert "reveal session.h5" in [command.line for command in console_lines(text)]
    for wrong in ("diagnos session.h5", "simulate --protocol rich", "fit session.h5 --method halves"):
        with pytest.raises(click.ClickException):
            parsed(wrong, whole=True)
    with pytest.raises(click.ClickException):
        parsed("report --onto FILE", whole=False)


def anchors(text: str) -> set[str]:
    """What the headings of a page are called in a link, after Python-Markdown's rule."""
    without_code = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    titles = re.findall(r"^#+ +(.+?) *$", without_code, flags=re.MULTILINE)
    return {re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", t).strip().lower()) for t in titles}


def broken_links(name: str, text: str, known: dict[str, str]) -> list[str]:
    """Links of the page ``name`` (a path below the repository) that lead nowhere."""
    wrong = []
    prose = re.sub(r"^```.*?^```|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", prose):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        place = (Path(ROOT / name).parent / path).resolve() if path else ROOT / name
        key = place.relative_to(ROOT).as_posix()
        found = anchor in anchors(known[key]) if anchor and key in known else place.exists() or key in known
        if not found:
            wrong.append(target)
    return wrong


def test_every_link_inside_the_documents_leads_somewhere(pages: dict[str, str]) -> None:
    known = {f"docs/{path}": text for path, text in pages.items()}
    known |= {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in WRITTEN}
    wrong = {name: broken_links(name, text, known) for name, text in known.items()}
    assert {name: links for name, links in wrong.items() if links} == {}
    assert broken_links("docs/index.md", "[a](nowhere.md) [b](theory.md#no-such)", known) == [
        "nowhere.md",
        "theory.md#no-such",
    ]


def test_files_that_the_documents_name_exist() -> None:
    roots = "fingerlab|ui|resources|tests|benchmarks|docs|packaging|requirements"
    for page in WRITTEN:
        for name in re.findall(rf"`((?:{roots})/[\w/.-]+)`", page.read_text(encoding="utf-8")):
            assert (ROOT / name).exists(), f"{page.name}: {name}"


def test_every_page_stands_in_the_navigation_once(generate: ModuleType, pages: dict[str, str]) -> None:
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    listed = re.findall(r":\s+([\w/-]+\.md)$", text, re.MULTILINE)
    assert {"index.md", "theory.md", "catalogue/index.md"} <= set(listed)
    nav = generate.navigation(
        [{"Catalogue": "catalogue/index.md"}, {"Validation": [{"x": p} for p in listed]}]
    )
    entries = [str(page) for page in generate._named(nav)]
    found = [page for page in entries if page != "catalogue/index.md"]
    assert sorted(found) == sorted(
        {*(p.relative_to(DOCS).as_posix() for p in DOCS.rglob("*.md")), *pages} - {"catalogue/index.md"}
    )


def test_the_catalogue_has_a_page_for_each_effect_with_all_that_its_object_holds(
    pages: dict[str, str],
) -> None:
    names = {Path(p).stem for p in pages if p.startswith("catalogue/")} - {"index"}
    assert names == set(CATALOGUE)
    for effect in CATALOGUE.values():
        page = pages[f"catalogue/{effect.id}.md"]
        for said in (effect.title, effect.explanation, effect.reveal, effect.coordinate):
            assert said in page, effect.id
        for name, gain in effect.unknowns.items():
            row = next(line for line in page.splitlines() if line.startswith(f"| `{name}` |"))
            cells = [cell.strip() for cell in row.strip("|").split("|")]
            assert cells[2] == gain.unit
            assert [float(v) for v in cells[3].split(" to ")] == pytest.approx(
                [gain.low, gain.high], rel=1e-5
            )
            assert float(cells[4]) == pytest.approx(gain.typical, rel=1e-5)
            assert cells[5] == gain.source


def test_every_page_of_the_catalogue_has_all_its_parts(pages: dict[str, str]) -> None:
    for name in CATALOGUE:
        page = pages[f"catalogue/{name}.md"]
        for part in (
            "## Equation",
            "$$",
            "## Unknowns",
            "## How it shows",
            "## How to tell",
            "What reveals it",
            "Source: ",
        ):
            assert part in page, (name, part)
        assert "Easily taken for it" in page or "Nothing else in the catalogue" in page, name
        assert "| source |" in page or name == "cable_slack", name  # which has no unknown


def test_every_effect_has_an_equation_and_look_alikes_that_exist() -> None:
    theory = (DOCS / "theory.md").read_text(encoding="utf-8")
    for name, effect in CATALOGUE.items():
        note = effect.formula
        assert note is not None, name
        assert note.equation, name
        assert note.symbols, name
        for year in re.findall(r"\b1[5-9]\d\d\b|\b20[012]\d\b", f"{note.symbols} {note.source}"):
            assert year in theory, (name, year)  # named in full among its sources
        assert name not in note.alike
        assert set(note.alike) <= set(CATALOGUE), name


def test_fingerprints_show_the_course_of_the_effect(pages: dict[str, str]) -> None:
    """Every effect is drawn and no flat line; a stiffness is a straight line, Coulomb friction two levels."""

    def course(name: str) -> np.ndarray:
        points = re.search(r'class="course" d="([^"]+)"', pages[f"catalogue/{name}.md"])
        assert points is not None
        return np.array([[float(v) for v in point[1:].split(",")] for point in points[1].split()])

    assert all(np.ptp(course(name)[:, 1]) > 100.0 for name in CATALOGUE)
    x, y = course("stiffness_error").T
    assert np.ptp(y - np.polyval(np.polyfit(x, y, 1), x)) < 0.5  # points are rounded to a tenth
    x, y = course("cable_slack").T  # loose at no tension, and nothing missing where it is taut
    assert np.ptp(y[x > x.min() + 1.0]) < 0.5
    assert np.ptp(y[x < x.min() + 0.5]) > 100.0
    height = course("coulomb_friction")[:, 1]
    at_an_end = np.minimum(np.abs(height - height.min()), np.abs(height - height.max())) < 0.05 * np.ptp(
        height
    )
    assert np.mean(at_an_end) > 0.9


def test_the_page_of_commands_has_all_of_them(pages: dict[str, str]) -> None:
    assert re.findall(r"^## (\S+)$", pages["commands.md"], re.MULTILINE) == list(COMMANDS)


def test_the_numbers_of_the_diagnosis_are_read_from_its_settings(pages: dict[str, str]) -> None:
    from fingerlab.diagnosis import settings

    made = sys.modules["stated"]
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \|", pages["decisions.md"], re.MULTILINE))
    assert float(rows["CORRELATED_VALUES"]) == settings.CORRELATED_VALUES
    assert float(rows["SAME_SHARE"]) == settings.SAME_SHARE
    assert rows["SAME_DIFFERENCE"].startswith("frequency hz 0.02, amplitude deg 1")
    every = [row for numbers in made.stated().values() for row in numbers]
    assert len(every) > 100
    assert all(made.shown(value) and said for _, value, said in every)
    assert made.shown({"a": object()}) == made.shown(float("inf")) == ""


def test_no_import_runs_up_an_arrow(generate: ModuleType) -> None:
    made = sys.modules["arrows"]
    rank, edges = made.ranks(), made.imports()
    assert [edge for edge in sorted(edges) if rank[edge[0]] >= rank[edge[1]]] == []
    folders = {path.parent.name for path in (ROOT / "fingerlab").glob("*/__init__.py")}
    assert folders <= {*rank, *made.GROUND}  # each part is drawn
    assert {("ui", "diagnosis"), ("cli", "diagnosis"), ("devices", "twin")} <= edges
    assert ("ui", "diagnosis") not in made.drawn(edges)  # it runs over the report
    page = (DOCS / "architecture.md").read_text(encoding="utf-8")
    svg = generate.on_page_markdown(page)
    assert svg.count('marker-end="url(#tip)"') == len(made.drawn(edges))


def test_formulas_become_mathml(generate: ModuleType) -> None:
    html = (
        '<p>so <span class="arithmatex">\\(a &lt; b\\)</span></p><div class="arithmatex">\\[\nx^2\n\\]</div>'
    )
    made = generate.on_page_content(html)
    assert made.count("<math") == 2
    assert "<msup><mi>x</mi><mn>2</mn></msup>" in made
    assert "&lt;" in made or "&#x0003C;" in made
    assert "arithmatex" not in made


def test_figures_of_the_tutorials_are_those_of_the_pictures() -> None:
    """``facts.toml`` is what the window said while the pictures were taken."""
    facts = tomllib.loads((DOCS / "images" / "facts.toml").read_text(encoding="utf-8"))
    named = 0
    for page in sorted((DOCS / "tutorials").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        asked = re.search(r"<!-- facts: (.+?) -->", text)
        for name in asked[1].split(", ") if asked else ():
            assert facts[name] in text.replace(asked[0], ""), (page.name, name, facts[name])
            named += 1
    assert named > 20


def test_every_picture_that_a_page_shows_is_there_and_every_picture_is_small() -> None:
    for page in WRITTEN:
        for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / name).is_file(), (page.name, name)
    size = {path: path.stat().st_size for path in (DOCS / "images").rglob("*.png")}
    assert sum(size[path] for path in size if path.parent.name == "images") < 6_500_000
    assert sum(size.values()) < 12_500_000


def test_each_point_of_the_window_is_there_in_both_themes_and_every_size() -> None:
    """Thirteen points; light and dark; 1280 x 800, 1920 x 1080, and 1280 x 800 at twice the scale."""
    pictures = {path.stem.rsplit("-", 2)[0]: [] for path in (DOCS / "images" / "points").iterdir()}
    for path in (DOCS / "images" / "points").iterdir():
        name, look, size = path.stem.rsplit("-", 2)
        pictures[name].append((look, size))
        with Image.open(path) as picture:
            assert picture.size == {"1280": (1280, 800), "1920": (1920, 1080), "2x": (2560, 1600)}[size]
    assert [name[:2] for name in sorted(pictures)] == [f"{number:02d}" for number in range(1, 14)]
    every = {(look, size) for look in ("light", "dark") for size in ("1280", "1920", "2x")}
    assert all(set(taken) == every for taken in pictures.values())


def test_the_summary_of_the_measurements_is_read_from_their_pages(generate: ModuleType) -> None:
    made = sys.modules["summary"]
    text = made.summary(DOCS)
    assert "memory, largest difference from the first minute" in text
    assert "six live plots of 60 s repainted" in text
    rows = [line.strip("| ").split(" | ") for line in text.splitlines()[2:]]
    assert len(rows) > 8
    for what, figure, link in rows:
        page = re.search(r"\((.+)\)", link)
        assert page is not None
        source = (DOCS / page[1]).read_text(encoding="utf-8")
        if "others" in what:
            continue  # counted, not copied
        for number in re.findall(r"\d+\.\d+|\d{2,}", figure.replace(",", "")):
            assert number in source.replace(",", ""), (figure, page[1])
    body = "| step | size | wall, s |\n|---|---|---|\n| diagnose | 1 | 7.25 |\n"
    assert list(made.tables("Text\n\n" + body)) == [
        (["step", "size", "wall, s"], [["diagnose", "1", "7.25"]])
    ]
    assert made.MARK in (DOCS / "validation.md").read_text(encoding="utf-8")


def test_the_pages_build_without_a_warning(tmp_path: Path) -> None:
    build = pytest.importorskip(
        "mkdocs.commands.build", reason="mkdocs builds the pages and is not installed"
    )
    from mkdocs.config import load_config

    config = load_config(str(ROOT / "mkdocs.yml"), site_dir=str(tmp_path / "site"), strict=True)
    config.plugins.on_startup(command="build", dirty=False)
    build.build(config)  # strict: any warning, such as a broken link, ends it
    theory = (tmp_path / "site" / "theory.html").read_text(encoding="utf-8")
    assert theory.count("<math") > 20
    assert theory.count("<mtable") >= 2
    for name in ("effect", "device"):  # the example itself stands in the page
        shown = (tmp_path / "site" / f"own-{name}.html").read_text(encoding="utf-8")
        first_line = (DOCS / f"own_{name}_example.py").read_text(encoding="utf-8").splitlines()[0]
        assert first_line.strip('"') in shown
    assert "Hidden effects</a></td>" in (tmp_path / "site" / "validation.html").read_text(encoding="utf-8")
    for file in (tmp_path / "site").rglob("*.html"):  # what the converter does not know it leaves as it is
        shown = file.read_text(encoding="utf-8")
        assert 'class="arithmatex"' not in shown
        for formula in re.findall(r"<math.*?</math>", shown, re.DOTALL):
            assert not re.search(r"\\|>&<|>&amp;<", formula), (file.name, formula)
    assert (tmp_path / "site" / "catalogue" / "capstan_friction.html").exists()


def test_the_example_of_a_device_keeps_to_the_protocol_and_turns() -> None:
    """A constant torque on inertia J with damping B: speed u (1 - exp(-B t / J)) with u = torque / B."""
    made = load("own_device_example")
    device = made.Rotor()
    assert isinstance(device, Device)
    device.open()
    device.start()
    device.set_enable(True)
    samples = [device.exchange(0.1) for _ in range(1001)]  # the first command acts from the second cycle on
    assert [s.index for s in samples] == list(range(1001))
    rate, final = made.DAMPING / made.INERTIA, made.TORQUE_PER_AMP * 0.1 / made.DAMPING
    expected = final * (1.0 - (1.0 - math.exp(-rate)) / rate)  # rad after 1 s
    assert samples[-1].raw[4] == pytest.approx(expected / (2 * math.pi) * made.COUNTS_PER_TURN, abs=1.01)
    assert device.make_safe()
    device.start()
    still = [device.exchange(0.0).raw[3] for _ in range(3)]
    assert still == [0.0, 0.0, 0.0]


def test_the_equations_that_pages_name_are_those_of_the_effects(generate: ModuleType) -> None:
    for effect in CATALOGUE.values():
        assert effect.equation in set(Row)
        assert effect.equation.name in generate.EQUATIONS
        assert set(effect.acts_on) <= set(generate.ACTS_ON)


def test_the_list_of_bundled_licences_names_every_locked_package() -> None:
    licences = load("licences", ROOT / "packaging")
    text = (ROOT / "packaging" / "LICENCES.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| ([\w.-]+) \| [\d.]+ \| (.+) \|$", text, re.MULTILINE))
    assert set(licences.locked()) == set(rows)
    assert "LGPL-3.0" in rows["pyside6-essentials"]

"""The page: one well-formed file that needs nothing else, with the numbers of its diagnosis."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree

import pytest

import fingerlab
from fingerlab.core.errors import Cancelled, UserError
from fingerlab.report.page import write_report
from fingerlab.sessions import open_session

XHTML = "{http://www.w3.org/1999/xhtml}"
SVG = "{http://www.w3.org/2000/svg}"
XLINK = "{http://www.w3.org/1999/xlink}href"


def parsed(page: str) -> ElementTree.Element:
    """The page as XML: an unclosed tag, a bare '<' or a twice given attribute would not pass."""
    assert page.startswith("<!DOCTYPE html>")
    return ElementTree.fromstring(page.removeprefix("<!DOCTYPE html>"))


def words(element: ElementTree.Element) -> str:
    """All text below an element, with single spaces."""
    return " ".join("".join(element.itertext()).replace("\u00a0", " ").split())


def table(root: ElementTree.Element, section: str, number: int = 0) -> list[list[str]]:
    """The cells of a table's body."""
    part = next(e for e in root.iter(f"{XHTML}section") if e.get("id") == section)
    body = list(part.iter(f"{XHTML}tbody"))[number]
    return [[words(cell) for cell in row] for row in body.iter(f"{XHTML}tr")]


def test_page_needs_no_other_file_and_runs_nothing(found_page) -> None:
    root, page = parsed(found_page), found_page
    for element in root.iter():
        assert element.tag.partition("}")[2] not in {"script", "link", "iframe", "object", "embed", "base"}
        for name, value in element.attrib.items():
            plain = name.rpartition("}")[2]
            assert not plain.startswith("on"), (element.tag, name)
            if plain in {"href", "src", "srcset", "data", "action", "poster"}:
                assert value.startswith(("#", "data:")), (element.tag, value)
    assert "@import" not in page
    assert all(target.startswith(("#", "data:")) for target in re.findall(r"url\(\s*['\"]?([^)]*)", page))
    assert set(re.findall(r"https?://[^\"'\s<)]+", page)) == {
        "http://www.w3.org/1999/xhtml",
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }  # names of XML vocabularies, which no browser fetches
    assert len(page.encode()) < 3_000_000


def test_every_identifier_is_unique_and_every_reference_arrives(write_page, alike) -> None:
    page = write_page(alike)
    root = parsed(page)
    identifiers = Counter(e.get("id") for e in root.iter() if e.get("id"))
    assert identifiers
    assert max(identifiers.values()) == 1
    wanted = set(re.findall(r"url\(#([^)]*)\)", page))
    for element in root.iter():
        target = element.get("href") or element.get(XLINK)
        if target is not None:
            wanted.add(target.removeprefix("#"))
    assert wanted <= set(identifiers)


def test_every_colour_and_font_that_is_used_is_defined(found_page) -> None:
    page = found_page
    defined = set(re.findall(r"--([a-z_]+):", page))
    assert set(re.findall(r"var\(--([a-z_]+)\)", page)) <= defined
    assert "#0072B2" in page  # modelled, in light
    style = page[page.index("<style>") : page.index("</style>")]
    assert "[&" not in style  # lists of colours are for other pictures
    assert "--over:" not in style
    assert "prefers-color-scheme: dark" in page
    assert "@media print" in page


def test_the_numbers_are_those_of_the_diagnosis(found_page) -> None:
    root = parsed(found_page)
    assert table(root, "errors") == [
        # 5.2 over 0.4 mN m, 41 over 3.6 µm, 0.912 over 0.051 N; R2 cut, never rounded up
        ["Joint torque", "5.20", "0.40", "mN m", "13.0", "", "0.874"],
        ["Cable length", "41.0", "3.6", "µm", "11.4", "", "0.99941"],
        ["Endpoint force", "0.912", "0.051", "N", "17.9", "", "−0.250"],
    ]
    assert table(root, "errors", 1) == [["Moment arm at the PIP, extension cable", "8.1 ± 0.2 mm"]]
    assert table(root, "effects") == [
        ["Coulomb joint friction", "83 %", "", "1.10", "found"],
        ["Not in the catalogue", "10 %", "", "", ""],
        ["Cable stretch", "4 %", "", "12.3", ""],
        ["Nothing missing", "3 %", "", "", ""],
        ["Tilted base", "< 1 %", "", "12.4", "these data could not show it"],
    ]
    assert table(root, "effects", 1) == [
        ["MCP friction torque", "3.4 ± 0.2 mN m"],
        ["PIP friction torque", "4.8 ± 0.2 mN m"],
        ["Travel", "0.08° (0.08 to 0.25)"],
    ]
    assert [row[1:3] for row in table(root, "all")] == [["83 %", "1.10"], ["4 %", "12.3"], ["< 1 %", "12.4"]]


def test_the_bars_are_as_long_as_the_probabilities(found_page) -> None:
    root = parsed(found_page)
    part = next(e for e in root.iter(f"{XHTML}section") if e.get("id") == "effects")
    widths = [e.get("style") for e in part.iter(f"{XHTML}span") if e.get("style")]
    assert widths == [f"width: {w}%" for w in ("83.0", "10.0", "4.0", "3.0", "0.0")]


def test_the_verdict_stands_at_the_top_in_one_sentence(found_page) -> None:
    root = parsed(found_page)
    verdict = next(e for e in root.iter(f"{XHTML}p") if "verdict" in (e.get("class") or ""))
    assert words(verdict) == (
        "Coulomb joint friction is missing from the nominal model (83 % probable): with it the error on runs "
        "left out of the fit falls from 12.4 to 1.10 times the bench's own repeatability."
    )
    assert words(root).index("83 % probable") < words(root).index("How far off the model is")


@pytest.mark.parametrize(
    ("which", "sentences"),
    [
        (
            "nothing",
            [
                "Nothing is missing from the nominal model (> 99 % probable)",
                "1.03 times",
                "no effect",
                "Next experiment No further recording is called for.",
            ],
        ),
        (
            "unseen",
            [
                "Nothing is missing from the nominal model that these data could show (82 % probable)",
                "could not have shown, at a plausible strength: cable stretch and tilted base.",
                "Record next: sine, 14°, 0.2 Hz, on air, extension cable.",
                "It would show cable stretch, if there (expected gain in log evidence 7.0; 5 decides).",
                "No effect is justified; these come closest.",
            ],
        ),
        (
            "unknown",
            [
                "not in the catalogue (> 99 % probable)",
                "63.2 times",
                "none of the 3 effects tried",
                "Next experiment No recording is known that would tell more.",
            ],
        ),
        (
            "alike",
            [
                "(98 % probable), and these data cannot tell which: Coulomb joint friction and cable stretch",
                "Record next: chirp, 11°, against a known load of 100 mN m, on air, flexion cable.",
                "would tell Coulomb joint friction from cable stretch (expected gain in log evidence 17.4",
            ],
        ),
    ],
)
def test_every_verdict_reads_as_a_result(write_page, which, sentences, request) -> None:
    diagnosis = replace(request.getfixturevalue(which), comparisons=(), failure=None)
    text = words(parsed(write_page(diagnosis)))
    for sentence in sentences:
        assert sentence.lower() in text.lower()


def test_what_the_data_could_not_show_is_no_evidence(write_page, unseen) -> None:
    root = parsed(write_page(replace(unseen, comparisons=(), failure=None)))
    marks = {row[0]: row[4] for row in table(root, "effects")}
    assert marks == {
        "Nothing missing": "",
        "Not in the catalogue": "",
        "Cable stretch": "these data could not show it",
        "Tilted base": "these data could not show it",
        "Coulomb joint friction": "",
    }
    part = next(e for e in root.iter(f"{XHTML}section") if e.get("id") == "effects")
    cards = [words(e) for e in part.iter(f"{XHTML}div") if e.get("class") == "card"]
    assert [card.startswith("Coulomb joint friction") for card in cards] == [True]


def test_figures_are_drawn_for_equations_fingerprint_failure_and_path(found_page) -> None:
    root = parsed(found_page)
    drawn = [svg.get("aria-label") for svg in root.iter(f"{SVG}svg")]
    assert [re.sub(r"[\d.]+ to [\d.]+ s", "", name) for name in drawn] == [
        "PIP torque where it is worst",
        "Where the PIP torque is off",
        "Error path",
        "Fingerprint of Coulomb joint friction",
        "PIP torque, run 002, on air, ",
        "PIP torque, run 001, on air, ",
    ]


def test_a_diagnosis_without_curves_still_makes_a_page(write_page, bare) -> None:
    root = parsed(write_page(bare))
    assert not [e for e in root.iter(f"{XHTML}section") if e.get("id") in ("curves", "where")]


def test_text_from_the_session_cannot_become_markup(write_page, bare) -> None:
    def change(file) -> None:
        file.attrs["title"] = "<script>alert(1)</script> & <b>bold"
        file.attrs["notes"] = '5 < 6 & "quoted"'

    root = parsed(write_page(bare, change=change))
    assert words(next(root.iter(f"{XHTML}h1"))) == "<script>alert(1)</script> & <b>bold"
    assert '5 < 6 & "quoted"' in words(root)


def test_the_recording_is_told_with_its_constants_and_hash(write_page, bare, tmp_path) -> None:
    root = parsed(write_page(bare))
    runs = table(root, "recording")
    assert runs == [
        ["001", "on air", "extension", "sine, 15°, 1 Hz", "4.0", "1000"],
        ["002", "in contact", "flexion", "sine, 15°, 1 Hz", "4.0", "1000"],
    ]
    rig = {row[0]: row[1:] for row in table(root, "recording", 1)}
    assert rig["Proximal mass"] == ["12 g", "± 2 %", "the session file"]
    assert rig["MCP stiffness"] == ["120 mN m/rad", "± 10 %", "the session file"]
    assert rig["Wrist angle"] == ["15°", "± 2 %", "the session file"]
    assert rig["Pulley radius"] == ["15 mm", "± 2 %", "the session file"]
    assert rig["Gravity"][1] == rig["Gear ratio"][1] == "–"
    footer = words(next(root.iter(f"{XHTML}footer")))
    assert hashlib.sha256((tmp_path / "session.h5").read_bytes()).hexdigest() in footer
    assert f"FingerLab {fingerlab.__version__}" in footer
    moment = re.search(r"\d{4}-\d\d-\d\dT[\d:]+[+-]\d\d:\d\d", footer)
    assert moment is not None
    assert datetime.fromisoformat(moment.group()).utcoffset() is not None


def test_runs_taken_alike_share_a_row(write_page, bare) -> None:
    phases = (("on_air", "extension"),) * 3 + (("contact", "flexion"),) * 2
    runs = table(parsed(write_page(bare, phases=phases)), "recording")
    assert [(row[0], row[4]) for row in runs] == [("001 to 003", "3 × 4.0"), ("004 to 005", "2 × 4.0")]


def test_a_page_that_is_there_stays(make_session, bare, tmp_path) -> None:
    path = tmp_path / "page.html"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(UserError, match="exists already and is not overwritten"):
        write_report([open_session(make_session())], path, diagnosis=bare)
    assert path.read_text(encoding="utf-8") == "mine"


def test_a_stopped_report_leaves_nothing(make_session, bare, tmp_path) -> None:
    session = open_session(make_session())
    before = set(tmp_path.iterdir())
    with pytest.raises(Cancelled):
        write_report([session], tmp_path / "page.html", diagnosis=bare, cancelled=lambda: True)
    assert set(tmp_path.iterdir()) == before


def test_a_missing_folder_is_found_out_before_the_work(make_session, tmp_path: Path) -> None:
    told: list[str] = []
    with pytest.raises(UserError, match="does not exist"):
        write_report(
            [open_session(make_session())],
            tmp_path / "no" / "p.html",
            progress=lambda _, what: told.append(what),
        )
    assert told == []


def test_progress_runs_from_nothing_to_one_and_never_back(make_session, bare, tmp_path: Path) -> None:
    shares: list[float] = []
    write_report(
        [open_session(make_session())],
        tmp_path / "page.html",
        diagnosis=bare,
        progress=lambda share, _: shares.append(share),
    )
    assert shares == sorted(shares)
    assert 0.0 <= shares[0] <= shares[-1] <= 1.0

"""The PDF: what the page says, on A4, with letters that can be found and figures that stay sharp."""

from __future__ import annotations

import io
import re
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from pypdf import PdfReader

from fingerlab.core.errors import UserError
from fingerlab.report.figure_style import FORMATS, NamedFigure
from fingerlab.report.page import Extras, write_report
from fingerlab.report.pdf import pdf_of_page, pieces, words
from fingerlab.report.pdf_paper import FigurePlace, PaperTable, PdfPaper, set_table
from fingerlab.sessions import open_session


def text_of(reader: PdfReader) -> str:
    return " ".join(" ".join(page.extract_text() for page in reader.pages).split())


@pytest.fixture
def written(make_session, found, tmp_path):
    """Page, PDF and figures of one diagnosis."""
    places = Extras(tmp_path / "page.pdf", tmp_path / "drawn")
    write_report([open_session(make_session())], tmp_path / "page.html", diagnosis=found, extras=places)
    return tmp_path


def test_pdf_and_figures_say_what_the_page_says(written) -> None:
    reader = PdfReader(written / "page.pdf")
    text = text_of(reader)
    page = (written / "page.html").read_text(encoding="utf-8")
    root = ElementTree.fromstring(page.removeprefix("<!DOCTYPE html>"))
    xhtml = "{http://www.w3.org/1999/xhtml}"
    for kind in ("h2", "h3", "caption", "td", "figcaption"):
        for element in root.iter(f"{xhtml}{kind}"):
            for word in "".join(element.itertext()).replace("\u00a0", " ").split():
                assert word in text.replace("- ", "-"), (kind, word)
    assert "12.4 to 1.10 times the bench's own repeatability" in text
    for page_of_paper in reader.pages:
        assert (float(page_of_paper.mediabox.width), float(page_of_paper.mediabox.height)) == pytest.approx(
            (595.28, 841.89), abs=0.02
        )
    parts = ["".join(e.itertext()) for e in root.iter(f"{xhtml}h2")]
    assert [str(entry.title) for entry in reader.outline] == parts
    # A figure's letters are letters, and nothing is a picture of dots.
    assert "PIP torque (mN m)" in text
    assert not any(list(p.images) for p in reader.pages)
    figures = sorted((written / "drawn").iterdir())
    svgs = len(re.findall(r"<svg", page))
    assert len(figures) == len(FORMATS) * svgs == 3 * 6
    assert figures[0].name == "01-error-path.pdf"
    dots = imread(written / "drawn" / "01-error-path.png")
    assert dots[0, 0].tolist() == [1.0] * 4  # white, not nothing: a dark page would hide the letters
    drawn = ElementTree.parse(written / "drawn" / "01-error-path.svg").getroot()
    heading = "".join(root.find(f".//{xhtml}h1").itertext()).strip()
    assert f"Error path – {heading}" in " ".join(
        "".join(drawn.itertext()).split()
    )  # of what, in the file itself


def test_a_name_that_ends_with_pdf_makes_a_pdf(make_session, bare, tmp_path) -> None:
    path = tmp_path / "report.pdf"
    assert write_report([open_session(make_session())], path, diagnosis=bare) == path
    assert "Versions and hashes" in text_of(PdfReader(path))


def test_an_equation_that_cannot_be_fitted_is_refused_and_leaves_nothing(
    make_session, bare, tmp_path
) -> None:
    session = open_session(make_session())
    before = set(tmp_path.iterdir())
    with pytest.raises(UserError, match="too few runs"):
        write_report(
            [session], tmp_path / "r.html", diagnosis=bare, extras=Extras(equation=tmp_path / "e.tex")
        )
    assert set(tmp_path.iterdir()) == before


def test_what_the_pdf_cannot_set_is_an_error_and_not_left_out() -> None:
    page = '<html xmlns="http://www.w3.org/1999/xhtml"><body><p>Text</p><video>x</video></body></html>'
    with pytest.raises(ValueError, match="<video>"):
        pdf_of_page(page, {}, "title")


def test_a_figure_lies_where_it_was_given_room() -> None:
    """A figure of 4 by 2 inches over the whole width of 174 mm: its own frame is drawn 174 by 87 mm."""
    figure = Figure(figsize=(4.0, 2.0))
    figure.text(0.0, 0.0, "CORNER", fontsize=10)
    page = (
        '<html xmlns="http://www.w3.org/1999/xhtml"><body><figure><svg xmlns="http://www.w3.org/2000/svg" '
        'id="f1"/><figcaption>Below</figcaption></figure></body></html>'
    )
    reader = PdfReader(io.BytesIO(pdf_of_page(page, {"f1": NamedFigure("a", "a", figure)}, "title")))
    seen: dict[str, tuple[float, float]] = {}

    def visit(text, cm, tm, *_):
        if text.strip():
            seen.setdefault(text.strip(), (tm[4] * cm[0] + cm[4], tm[5] * cm[3] + cm[5]))

    reader.pages[0].extract_text(visitor_text=visit)
    mm = 72 / 25.4
    x, y = seen["CORNER"]
    assert x == pytest.approx(18 * mm, abs=2)
    assert y == pytest.approx(841.89 - (18 + 1 + 87) * mm, abs=3)
    assert seen["Below"][1] < y


def test_a_figure_shrinks_a_little_before_it_leaves_the_rest_of_a_page_empty() -> None:
    """A4 has 297 - 18 - 20 = 259 mm of height: below one of 130 mm and its gap there is room for 123."""
    paper = PdfPaper("title")
    for key in ("first", "second"):
        paper.figures([FigurePlace(key, 130.0 / 174.0, "", 1.0)], 1)
    first, second = paper.placed
    assert (first.page, first.width) == (1, pytest.approx(174.0, rel=1e-4))
    assert second.page == 1
    assert second.width == pytest.approx(174.0 * 123.0 / 130.0, rel=1e-3)
    paper = PdfPaper("title")
    for key in ("first", "too high to shrink so far"):
        paper.figures([FigurePlace(key, 170.0 / 174.0, "", 1.0)], 1)
    assert [(one.page, one.width) for one in paper.placed] == [
        (n, pytest.approx(174.0, rel=1e-4)) for n in (1, 2)
    ]


def test_heads_wrap_before_names_do_and_names_before_sentences() -> None:
    paper = PdfPaper("title")
    head = ["Model", *(["Peak of what was modelled (N)"] * 6)]
    set_table(
        paper, PaperTable("", head, [["With the effects", *["1.234 ± 0.001"] * 6]], [False] + [True] * 6)
    )
    tale = " ".join(["the missing torque follows the speed"] * 6)
    set_table(
        paper, PaperTable("", [], [["Other inertia of rotor, gearbox and pulley", tale]], [False, False])
    )
    told = [["Stribeck friction in motor and gearbox", "1.23", tale]]
    set_table(paper, PaperTable("", ["Effect", "Error with it", "What was seen"], told, [False, True, False]))
    lines = PdfReader(io.BytesIO(bytes(paper.output()))).pages[0].extract_text().splitlines()
    assert any(line.startswith("with it") for line in lines)  # two lines, not three
    assert any("With the effects" in line for line in lines)
    assert not any("gearbox and pulley" in line for line in lines)
    assert sum("torque" in line for line in lines) <= 3 + 4


def test_an_index_stands_smaller_and_below_the_line() -> None:
    note = ElementTree.fromstring(
        '<p xmlns="http://www.w3.org/1999/xhtml">so <var>f<sub>H</sub></var>: friction</p>'
    )
    paper = PdfPaper("title")
    paper.paragraph(words(note), pieces=pieces(note))
    paper.paragraph("next")
    sizes: dict[str, float] = {}
    page = PdfReader(io.BytesIO(bytes(paper.output()))).pages[0]
    page.extract_text(visitor_text=lambda text, cm, tm, font, size: sizes.update({text.strip(): size}))
    assert sizes["H"] < sizes["f"] == sizes[": friction"] == sizes["next"]
    rises = re.findall(rb"(\S+) Ts", page.get_contents().get_data())
    assert [float(rise) < 0.0 for rise in rises] == [True]


def test_no_page_begins_with_a_single_row_or_the_end_of_a_short_paragraph() -> None:
    """A row of one line is 7.5 points times 1.42 and 1.2 mm high: 4.96 mm."""
    rows = [[f"row {k}", str(k)] for k in range(1, 11)]
    for left, last in ((10.5, 0), (9.5, 3), (8.5, 3), (6.5, 4)):
        paper = PdfPaper("title")
        paper.set_y(paper.h - paper.b_margin - left * 4.96)
        set_table(paper, PaperTable("", [], rows, [False, True]))
        pages = [page.extract_text() for page in PdfReader(io.BytesIO(bytes(paper.output()))).pages]
        assert sum(page.count("row ") for page in pages) == 10
        assert [page.count("row ") for page in pages[1:]] == [last] * (last > 0), left
    for left, pages_taken in ((3.5, 1), (2.5, 2)):  # head and two rows are three lines
        paper = PdfPaper("title")
        paper.set_y(paper.h - paper.b_margin - left * 4.96)
        set_table(paper, PaperTable("", ["what", "hash"], rows[:2], [False, True]))
        assert len(PdfReader(io.BytesIO(bytes(paper.output()))).pages) == pages_taken, left
    paper = PdfPaper("title")
    paper.set_y(paper.h - paper.b_margin - 6.0)
    paper.paragraph("These words are so many that they need two lines and more of a page. " * 2)
    pages = PdfReader(io.BytesIO(bytes(paper.output()))).pages
    assert ["words" in page.extract_text() for page in pages] == [False, True]

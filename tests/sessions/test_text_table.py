"""How a text file is laid out, and which line is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.sessions.text_table import inspect_table, read_blocks, read_rows


def table_of(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "a.txt"
    path.write_bytes(text.encode(encoding))
    table = inspect_table(path)
    return table, np.concatenate(list(read_blocks(table, block_lines=2)))


@pytest.mark.parametrize(
    ("text", "separator", "decimal"),
    [
        ("0.5\t-1.25\n1.0\t2e-3\n", "\t", "."),
        ("0,5\t-1,25\n1,0\t2e-3\n", "\t", ","),
        ("0.5;-1.25\n1.0;2e-3\n", ";", "."),
        ("0,5;-1,25\n1,0;2e-3\n", ";", ","),
        ("0.5, -1.25\n1.0, 2e-3\n", ",", "."),
        ("  0.5   -1.25\n 1.0  2e-3\n", None, "."),
        ("0,5 -1,25\r\n1,0 2e-3\r\n", None, ","),
    ],
)
@pytest.mark.parametrize("preface", ["", "# recorded by hand\n\n", "\ufeff"])
def test_separator_and_decimal_sign_are_recognised(tmp_path, text, separator, decimal, preface):
    table, values = table_of(tmp_path, preface + text)
    assert (table.separator, table.decimal, table.header) == (separator, decimal, None)
    np.testing.assert_array_equal(values, [[0.5, -1.25], [1.0, 0.002]])


def test_a_header_is_recognised_in_any_code_page(tmp_path):
    for encoding in ("utf-8", "cp1252", "utf-16"):
        table, values = table_of(tmp_path, "time (s)\tMCP (°)\n0\t1\n1\t2\n", encoding)
        assert table.header == ("time (s)", "MCP (°)")
        assert values.tolist() == [[0.0, 1.0], [1.0, 2.0]]


def test_what_stands_above_the_table_is_no_part_of_it(tmp_path):
    """A logger tells itself, then names, then units in a row of their own."""
    above = "Machine: press;;\nSamples;2;\n\nTime;Way;F\n[s];[mm];[kN]\n"
    table, values = table_of(tmp_path, above + "0,0;1,5;2\n0,1;1,6;2\n")
    assert table.header == ("Time (s)", "Way (mm)", "F (kN)")
    assert table.ahead == 4
    assert values.tolist() == [[0.0, 1.5, 2.0], [0.1, 1.6, 2.0]]


def test_times_of_day_are_seconds(tmp_path):
    table, values = table_of(tmp_path, "stamp,x\n23:59:59.5,1\n0:00:00.25,2\n")
    assert table.header == ("stamp (s)", "x")
    assert values.tolist() == [[86399.5, 1.0], [0.25, 2.0]]
    dated = "stamp;x\n1970-01-02 00:00:01,5;1,5\n1970-01-02T00:00:02,5;2\n"
    assert table_of(tmp_path, dated)[1].tolist() == [[86401.5, 1.5], [86402.5, 2.0]]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("0\t1\t2\n1\t2\n2\t3\t4\n", r"a\.txt, line 2 has 2 columns where the first row has 3"),
        ("t\ta\n0\t1\n1\t2\n\n3\t4\t5\n", r"a\.txt, line 5 has 3 columns where the first row has 2"),
        (
            "0\t1\n1\tbad\n",
            r"a\.txt, line 2, column 2 holds 'bad'; it should be a number with a decimal point",
        ),
        (
            "0,0\t1,5\n1,0\t2.5\n",
            r"line 2, column 2 holds '2\.5'; it should be a number with a decimal comma",
        ),
        ("0\t1\n1\n2\t3\n", "line 2 has 1 columns"),
        ("0\t1\n1\t\n", "line 2, column 2 holds ''"),
        ("0,1,RUN\n1,2,STOP\n", "column 3 holds 'RUN'; it should be a number"),
        ("0;1,5\n1;1.001,5\n", r"line 2, column 2 holds '1\.001,5'"),
        ("0\t1\t5\n1\t\t5\n", "line 2, column 2 holds ''"),
        ("t\tx\n", "holds a header but no rows|no row of two numbers"),
        ("", "is empty; it should hold a table of numbers"),
        ("once upon a time\nthere was a finger\n", "no row of two numbers or more in its first 2 lines"),
        ("1\n2\n3\n", "no row of two numbers or more"),
        ("0\t1\n\0\0\0", "is not a text file"),
    ],
)
def test_what_does_not_fit_is_named_by_file_and_line(tmp_path, text, sentence):
    with pytest.raises(UserError, match=sentence):
        table_of(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "separator", "decimal", "header"),
    [
        ("t,mode,x\n0,AUTO,1.5\n1,AUTO,2.5\n", ",", ".", ("t", "mode", "x")),
        ("t;mode;x\n0,0;AUTO 1;1,5\n1,0;AUTO 1;2,5\n", ";", ",", ("t", "mode", "x")),
        ('"t","mode","x"\n"0,0","AUTO","1,5"\n"1,0","AUTO","2,5"\n', ",", ",", ("t", "mode", "x")),
        ("t mode x\n0 AUTO 1.5\n1 AUTO 2.5\n", None, ".", ("t", "mode", "x")),
    ],
)
def test_a_column_of_words_is_left_among_the_numbers(tmp_path, text, separator, decimal, header):
    path = tmp_path / "a.txt"
    path.write_text(text, encoding="utf-8")
    table = inspect_table(path)
    assert (table.separator, table.decimal, table.header) == (separator, decimal, header)
    assert list(table.words) == [1]
    (rows,) = read_rows(table)
    assert rows.values[:, [0, 2]].tolist() == [[0.0, 1.5], [1.0, 2.5]]
    assert np.isnan(rows.values[:, 1]).all()
    assert rows.faults == ()


@pytest.mark.parametrize("header", ["t;x;\n", "t;x\n", ""])
def test_a_separator_behind_the_last_number_is_no_column(tmp_path, header):
    table, values = table_of(tmp_path, header + "0;1,5;\n1;2,5;\n2;3,5\n")
    assert (table.columns, table.words) == (2, {})
    assert table.header == (("t", "x") if header else None)
    assert values.tolist() == [[0.0, 1.5], [1.0, 2.5], [2.0, 3.5]]


def test_quotes_are_none_of_a_number(tmp_path):
    table, values = table_of(tmp_path, '"t (s)";"x; y"\n"0,5";"-1"\n"1,5";"2"\n')
    assert table.header == ("t (s)", "x; y")
    assert values.tolist() == [[0.5, -1.0], [1.5, 2.0]]


def test_what_cannot_be_read_is_told_with_its_line(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("t,x\n0,1\n\n1,\n2\n3,4\n", encoding="utf-8")
    (rows,) = read_rows(inspect_table(path))
    assert rows.lines.tolist() == [2, 4, 5, 6]
    assert [(fault.row, fault.column) for fault in rows.faults] == [(1, 1), (2, None)]
    np.testing.assert_array_equal(rows.values, [[0, 1], [1, np.nan], [np.nan, np.nan], [3, 4]])


def test_a_bad_row_far_down_has_the_right_line(tmp_path):
    rows = [f"{i * 0.001:.3f}\t{i}" for i in range(200_000)]
    rows[150_000] = "150.000"
    (tmp_path / "a.txt").write_text("\n".join(["t (s)\tx", *rows]), encoding="utf-8")
    with pytest.raises(UserError, match="line 150002 has 1 columns"):
        list(read_blocks(inspect_table(tmp_path / "a.txt")))


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(UserError, match="cannot be read"):
        inspect_table(tmp_path / "none.txt")
    with pytest.raises(UserError, match="cannot be read"):
        inspect_table(tmp_path)

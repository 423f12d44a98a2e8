"""A user's own effects: nothing runs unconfirmed, and what is wrong in a file is told with its line."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.core.trust import settings_file
from fingerlab.effects import CATALOGUE, effect, own, whole_catalogue
from fingerlab.effects.base import Row

from .moving import bench, moving

EXAMPLE = Path(__file__).parents[2] / "docs" / "own_effect_example.py"
HEAD = "import numpy as np\nfrom fingerlab.effects import Effect, Gain, Row, Term\n"
GOOD = (
    HEAD
    + """
def columns(motion, shape):
    return [Term(Row.CABLE, "size", np.tanh(motion.velocity), "direct")]

EFFECT = Effect(
    id="my_slip", title="Slip", acts_on=("cable_kinematics",), gains={"size": Gain("m", 0.0, 0.01, 0.001)},
    columns=columns, coordinate="motor speed", equation=Row.CABLE, explanation="The cable slips.",
    reveal="slow sines",
)
"""
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A chosen folder, and settings that are this test's own."""
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    made = tmp_path / "my effects, Łódź"
    made.mkdir()
    own.set_folder(made)
    return made


def put(folder: Path, text: str, name: str = "mine.py") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def confirmed(folder: Path, text: str, name: str = "mine.py") -> own.OwnFile:
    return own.trust(own.find(put(folder, text, name)), CATALOGUE)


def test_a_new_file_is_never_run_and_waits(folder: Path, tmp_path: Path) -> None:
    mark = tmp_path / "it ran"
    put(folder, f"open({str(mark)!r}, 'w').close()\n{GOOD}")
    assert whole_catalogue() == CATALOGUE
    (file,) = own.own_files(CATALOGUE)
    assert (file.state, file.effects) == ("waiting", ())
    assert "fingerlab effects --trust mine.py" in file.notice
    assert not mark.exists()
    own.trust(own.find(Path("mine.py")), CATALOGUE)
    assert mark.exists()  # the mark would have told


def test_a_confirmed_effect_joins_the_catalogue_and_stays_the_same_object(folder: Path) -> None:
    assert [e.id for e in confirmed(folder, GOOD).effects] == ["my_slip"]
    assert list(whole_catalogue()) == [*CATALOGUE, "my_slip"]
    assert effect("my_slip") is whole_catalogue()["my_slip"]
    assert "my_slip" not in CATALOGUE
    assert own.notices(CATALOGUE) == ()


def test_a_changed_file_is_not_run_until_it_is_confirmed_anew(folder: Path, tmp_path: Path) -> None:
    confirmed(folder, GOOD)
    mark = tmp_path / "it ran"
    put(folder, f"open({str(mark)!r}, 'w').close()\n{GOOD}")
    assert "my_slip" not in whole_catalogue()
    (sentence,) = own.notices(CATALOGUE)
    assert "was changed since you confirmed it" in sentence
    assert not mark.exists()
    put(folder, GOOD)  # the content that was confirmed, back again
    assert "my_slip" in whole_catalogue()


def test_only_the_chosen_folder_counts_and_forgetting_withdraws_everything(
    folder: Path, tmp_path: Path
) -> None:
    confirmed(folder, GOOD)
    outside = put(tmp_path, GOOD, "outside.py")
    with pytest.raises(UserError, match="not a Python file in"):
        own.find(outside)
    own.forget()
    assert whole_catalogue() == CATALOGUE
    own.set_folder(folder)
    assert [f.state for f in own.own_files(CATALOGUE)] == ["waiting"]


def test_confirming_holds_for_what_was_shown_and_not_for_what_came_after(folder: Path) -> None:
    shown = own.find(put(folder, GOOD))
    put(folder, GOOD + "\n# another line\n")
    with pytest.raises(UserError, match="changed meanwhile"):
        own.trust(shown, CATALOGUE)
    assert "my_slip" not in whole_catalogue()


def test_without_a_folder_or_with_a_wrong_one_a_sentence_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path))
    with pytest.raises(UserError, match="--folder DIR"):
        own.find(Path("mine.py"))
    with pytest.raises(UserError, match="is not a folder"):
        own.set_folder(tmp_path / "nowhere")
    settings_file().write_text('{"format": "fingerlab-own-effects", "folder": 3}', encoding="utf-8")
    with pytest.raises(UserError, match=r"damaged.*remove it"):
        whole_catalogue()


def with_more(more: str) -> str:
    """The good file with something added to its effect."""
    return GOOD.replace('reveal="slow sines"', f'reveal="slow", {more}')


def with_gain(more: str) -> str:
    """The good file with something added to its gain."""
    return GOOD.replace("0.01, 0.001)", f"0.01, 0.001, {more})")


def with_example(expected: str) -> str:
    """The good file with an example of a motor that begins to turn by 1 rad/s."""
    more = with_more(f'example=Example({{}}, {{"velocity": [0.0, 1.0]}}, {{{expected}}})')
    return more.replace("import Effect,", "import Effect, Example,")


def with_values(values: str) -> str:
    """The good file with other values in its column."""
    return GOOD.replace("np.tanh(motion.velocity)", values)


BROKEN = [
    ("syntax", "x = (1,\ny = 2\n", r"line 1: SyntaxError"),
    ("while running", HEAD + "\nvalue = 1 / 0\n", r"line 4: ZeroDivisionError: division by zero"),
    ("leaving", "import sys\nsys.exit(3)\n", r"line 2: SystemExit"),
    ("nothing in it", HEAD, r"either EFFECT = Effect\(\.\.\.\) or EFFECTS"),
    ("no list", HEAD + "EFFECTS = 5\n", r"no list of effects"),
    ("not an effect", HEAD + "EFFECT = 5\n", r"offers a int as an effect"),
    ("in the columns", GOOD.replace("motion.velocity", "motion.speeed"), r"line 5: AttributeError: .*speeed"),
    ("length", with_values("np.zeros(7)"), r"shape \(7,\) for gain 'size'"),
    ("at standstill", with_values("1 / motion.velocity"), r"not a finite number"),
    ("complex", GOOD.replace("np.tanh", "1j * np.tanh"), r"real numbers"),
    ("no term", GOOD.replace('return [Term(Row.CABLE, "size", np.tanh(motion.velocity), "direct")]',
                             "return [motion.velocity]"), r"hold a ndarray; each should be a Term"),
    ("gain unknown", GOOD.replace('CABLE, "size"', 'CABLE, "sise"'), r"uses the gain 'sise'"),
    ("gain unused", GOOD.replace('{"size"', '{"other": Gain("m", 0, 1, 1), "size"'), r"never uses .*'other'"),
    ("range", GOOD.replace("0.0, 0.01", "0.02, 0.01"), r"low should be below high"),
    ("typical", GOOD.replace("0.01, 0.001", "0.01, 0.0"), r"typical 0\.0; it should be above 0"),
    ("family", GOOD.replace('("cable_kinematics",)', '"cable_kinematics"'), r"acts_on is 'cable_kinematics'"),
    ("coordinate", GOOD.replace('"motor speed"', '"pulley"'), r"one of time, joint speed"),
    ("id", GOOD.replace("my_slip", "My slip"), r"bad id"),
    ("taken", GOOD.replace("my_slip", "coulomb_friction"), r"belongs to the built-in catalogue"),
    ("bench", with_more('bench=True'), r"should stand in Row.BENCH"),
    ("shape", with_more('shapes=({"gap": 1.0},)'), r"as shape_units"),
    ("special", with_more('special="delay"'), r"by its columns alone"),
    ("turned face", with_more('turns=lambda shape: 0.1'), r"by its columns alone"),
    ("a field of earlier versions", with_more('offsets=("size",)'), r"line 7: TypeError: .*'offsets'"),
    ("cables", with_more('cables=("wire",)'), r"cables is \('wire',\)"),
    ("where on the bench", with_more('bench="here"'), r"bench is 'here'; .*beside a finger"),
    ("no example", with_more('example={}'), r"example that is none"),
    ("example", with_example('"CABLE size": [0.0, 0.5]'), r"expects 0.5 for .* 1, and it is 0.7615"),
    ("example's column", with_example('"PIP size": 0.0'), r"column 'PIP size', and there are CABLE size"),
    ("title", with_gain('title=3'), r"title, name or symbol that is no text"),
    ("family", with_more('family="Wings"'), r"family is 'Wings'; it should be one of Joint friction"),
    ("formula", with_more('formula="x = 1"'), r"formula is a str"),
    ("units of shapes", with_more('shape_units=["gap"]'), r"shape_units \['gap'\]"),
    ("closer", with_more('closer=3'), r"closer that cannot be called"),
    ("what closer gives", with_more('closer=lambda shape: [{"gap": "wide"}]'), r"closer gives"),
    ("excess of nothing", with_gain('excess_of="sise"'), r"excess of 'sise'"),
    ("degenerate", with_gain('degenerate_with="loss"'), r"say which gain it is the excess_of"),
    ("degenerate with what", with_gain('degenerate_with="arms"'), r"degenerate_with is 'arms'"),
    ("limits", with_gain('limits=lambda shape: (0.0, 1.0)'), r"limits \(0.0, 1.0\)"),
    ("no limits", with_gain('limits=1.0'), r"limits that cannot be called"),
    ("varies", with_gain('varies_between_runs="yes"'), r"varies_between_runs is 'yes'"),
    ("role", with_gain('role=3'), r"role is 3"),
    ("terms by phase", GOOD.replace("    return [", "    if motion.force is None:\n"
     "        return [Term(Row.CABLE, 'size', motion.velocity), Term(Row.MCP, 'size', motion.velocity)]\n"
     "    return ["), r"gives other terms in a motion 'contact'"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "told"), [b[1:] for b in BROKEN], ids=[b[0] for b in BROKEN])
def test_what_is_wrong_in_a_file_is_one_sentence_that_names_it(folder: Path, text: str, told: str) -> None:
    file = confirmed(folder, text)
    assert file.effects == ()
    assert file.problem.startswith(str(folder / "mine.py")), file.problem
    assert "\n" not in file.problem
    assert re.search(told, file.problem), file.problem
    assert whole_catalogue() == CATALOGUE
    assert "left out" in file.notice


def test_a_good_example_is_as_welcome_as_none(folder: Path) -> None:
    assert confirmed(folder, with_example('"CABLE size": [0.0, np.tanh(1.0)]')).problem == ""


def test_two_files_with_one_id_keep_the_first(folder: Path) -> None:
    confirmed(folder, GOOD, "a.py")
    second = confirmed(folder, GOOD + "\n", "b.py")
    assert str(folder / "a.py") in second.problem
    assert effect("my_slip") is own.own_files(CATALOGUE)[0].effects[0]


def test_a_fault_on_data_that_no_probe_had_is_told_with_its_line(folder: Path) -> None:
    text = GOOD.replace("    return [", "    assert motion.velocity.max() < 50\n    return [")
    (one,) = confirmed(folder, text).effects
    with pytest.raises(UserError, match=r"mine\.py, line 5: AssertionError.*'my_slip'"):
        one.columns(moving(velocity=np.full(1000, 80.0)), {})


def test_data_classes_and_helpers_of_the_catalogue_work_in_a_file(folder: Path) -> None:
    text = (
        "from __future__ import annotations\nfrom dataclasses import dataclass\n"
        "from fingerlab.effects.joints import joint_terms\n"
        "@dataclass(frozen=True)\nclass Law:\n    power: float\n"
        + GOOD.replace("np.tanh(motion.velocity)", "Law(2.0).power * motion.velocity")
    )
    assert confirmed(folder, text).problem == ""


def test_another_process_is_given_the_confirmed_files_alone(folder: Path) -> None:
    confirmed(folder, GOOD)
    put(folder, GOOD.replace("my_slip", "unasked"), "b.py")
    sources = own.trusted_sources(CATALOGUE)
    own.forget()
    with own.only_these(sources):
        assert list(whole_catalogue()) == [*CATALOGUE, "my_slip"]
    assert whole_catalogue() == CATALOGUE


def test_the_example_of_the_documentation_is_good(folder: Path) -> None:
    shutil.copy(EXAMPLE, folder)
    (one,) = own.trust(own.find(Path(EXAMPLE.name)), CATALOGUE).effects
    motion = moving(velocity=np.full(1000, -4.0))
    for term, row in zip(one.columns(motion, {}), (Row.MCP, Row.PIP), strict=True):
        assert (term.row, term.gain) == (row, "root")
        assert term.values == pytest.approx(np.full(1000, -2.0 / motion.radius))
    (term,) = one.columns(bench(velocity=np.full(1000, 9.0)), {})
    assert (term.row, float(term.values[0])) == (Row.BENCH, pytest.approx(3.0))

"""Sessions from the simulated rig: protocols, seals, and the two commands."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from fingerlab.cli.simulate import reveal, simulate
from fingerlab.core.errors import UserError
from fingerlab.sessions import open_session
from fingerlab.twin.effects import EFFECTS
from fingerlab.twin.protocols import PROTOCOLS, RunPlan, load_preset, parse_preset, single_run
from fingerlab.twin.session import pick_hidden, reveal_session, seal, unseal, write_session

SHORT = [
    RunPlan(
        "on_air", "extension", {"kind": "sine", "amplitude_deg": 14, "offset_deg": 22, "duration_s": 2.0}
    ),
    RunPlan("contact", "flexion", {"kind": "sine", "amplitude_deg": 2, "duration_s": 2.0}),
]


def test_thesis_protocol_is_the_one_of_the_thesis() -> None:
    plans = PROTOCOLS["thesis"](2.0)
    assert [(p.phase, p.cable) for p in plans] == [("on_air", "extension")] * 10 + [
        ("contact", "flexion")
    ] * 10
    assert all(p.trajectory["duration_s"] == 30.0 and p.trajectory["frequency_hz"] == 1.0 for p in plans)
    assert all(p.trajectory["amplitude_deg"] == 15.0 and p.trajectory["kind"] == "sine" for p in plans[:10])


def test_rich_protocol_has_the_kinds_of_run_of_the_shared_recordings(shared_data: Path) -> None:
    def kinds(runs: list[tuple[str, str, str]]) -> Counter[tuple[str, str, str]]:
        return Counter(runs)

    theirs = [
        (r.phase, r.cable, r.trajectory["kind"]) for r in open_session(shared_data / "bench-plain.h5").runs
    ]
    ours = [(p.phase, p.cable, p.trajectory["kind"]) for p in PROTOCOLS["rich"](2.0)]
    assert kinds(ours) == kinds(theirs)


def test_motor_bench_needs_no_finger(tmp_path: Path) -> None:
    path = tmp_path / "motor.h5"
    write_session(path, load_preset(), "motor-bench", PROTOCOLS["motor-bench"](2.0), {}, 1)
    runs = open_session(path).runs
    assert {r.phase for r in runs} == {"motor_bench"}
    assert not runs[0].has("mcp_angle")
    assert sorted({round(float(r.channel("load_torque")[0]), 6) for r in runs}) == [0.0, 0.04, 0.09]
    slow = runs[4]  # ramp and hold against 0.04 N m: nothing but the load to carry
    assert slow.channel("motor_torque")[5000:].mean() == pytest.approx(0.04, rel=0.05)


def test_every_protocol_names_existing_phases() -> None:
    for name, build in PROTOCOLS.items():
        assert build(2.0), name


def test_sealed_session_does_not_betray_itself(tmp_path: Path) -> None:
    path = tmp_path / "sealed.h5"
    told = None
    for seed in range(40):  # a seed that picks an effect, not nothing
        if reveal_dry(seed):
            told = write_session(path, load_preset(), "short", SHORT, {}, seed, hidden=True)
            break
    assert told is not None
    assert told.effects is None
    assert told.seed is None
    hidden = reveal_session(path)
    assert hidden["sealed"] and set(hidden["effects"]) <= set(EFFECTS)  # noqa: PT018
    (effect,) = hidden["effects"]
    content = path.read_bytes()
    assert effect.encode() not in content
    assert json.dumps(told.to_json()).count(effect) == 0
    with h5py.File(path) as file:
        texts = [str(v) for k, v in file.attrs.items() if k != "sealed"]
        assert not any(effect in t or '"seed"' in t for t in texts)


def reveal_dry(seed: int) -> bool:
    from fingerlab.twin.session import _hidden_rng

    return bool(pick_hidden(["on_air", "contact"], _hidden_rng(seed)))


def test_practice_always_hides_an_effect_that_the_protocols_show() -> None:
    rng = np.random.default_rng(0)
    drawn = [pick_hidden(["on_air", "contact"], rng, practice=True) for _ in range(300)]
    assert {name for effects in drawn for name in effects} == {e.id for e in EFFECTS.values() if e.practised}
    for effects in drawn:
        ((name, values),) = effects.items()
        first = EFFECTS[name].parameters[0]
        assert min(EFFECTS[name].defaults()[first.name], first.high) <= values[first.name] <= first.high


def test_hidden_session_has_the_effect_that_it_reveals(tmp_path: Path) -> None:
    seed = next(s for s in range(40) if reveal_dry(s))
    write_session(tmp_path / "sealed.h5", load_preset(), "short", SHORT, {}, seed, hidden=True)
    effects = reveal_session(tmp_path / "sealed.h5")["effects"]
    write_session(tmp_path / "open.h5", load_preset(), "short", SHORT, effects, seed)
    for sealed, opened in zip(
        open_session(tmp_path / "sealed.h5").runs, open_session(tmp_path / "open.h5").runs, strict=True
    ):
        for channel in ("motor_torque", "pip_angle", "endpoint_force"):
            assert np.array_equal(sealed.channel(channel), opened.channel(channel))


def test_hidden_effects_cover_the_catalogue_and_sometimes_none() -> None:
    rng = np.random.default_rng(1)
    picks = [tuple(pick_hidden(["on_air", "contact"], rng)) for _ in range(2000)]
    assert {p[0] for p in picks if p} == set(EFFECTS)
    assert sum(not p for p in picks) / 2000 == pytest.approx(0.15, abs=0.03)
    assert all("contact" not in EFFECTS[p].phases or "on_air" in EFFECTS[p].phases
               for pick in [pick_hidden(["on_air"], rng) for _ in range(200)] for p in pick)  # fmt: skip


def test_seals_have_one_length_and_notice_a_change() -> None:
    short, long = seal({"effects": {}, "seed": 1}), seal({"effects": {"backlash": {"play": 0.01}}, "seed": 2})
    assert len(short) == len(long)
    assert unseal(long, "it") == {"effects": {"backlash": {"play": 0.01}}, "seed": 2}
    with pytest.raises(UserError, match=r"seal of it is damaged"):
        unseal(long[:40] + ("A" if long[40] != "A" else "B") + long[41:], "it")


def test_commands_write_reveal_and_never_overwrite(tmp_path: Path) -> None:
    out = tmp_path / "s.h5"
    single = ["--trajectory", '{"kind": "sine", "amplitude_deg": 10, "offset_deg": 20, "duration_s": 2}']
    arguments = [
        *single,
        "--phase",
        "on_air",
        "--effect",
        "cable_slack=0.002",
        "--seed",
        "3",
        "--out",
        str(out),
    ]
    result = CliRunner().invoke(simulate, [*arguments, "--json", "-"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["effects"] == {"cable_slack": {"travel": 0.002}}
    before = out.read_bytes()
    again = CliRunner().invoke(simulate, arguments)
    assert isinstance(again.exception, UserError)
    assert out.read_bytes() == before
    told = CliRunner().invoke(reveal, [str(out), "--json", "-"])
    assert json.loads(told.stdout)["effects"] == {"cable_slack": {"travel": 0.002}}
    assert json.loads(told.stdout)["seed"] == 3
    assert "cable_slack: travel = 0.002 m" in CliRunner().invoke(reveal, [str(out)]).output


def test_a_recording_that_was_not_simulated_has_nothing_to_reveal(make_session: object) -> None:
    path = make_session()  # type: ignore[operator]
    with pytest.raises(UserError, match="not simulated"):
        reveal_session(path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "--protocol"),
        (["--protocol", "rich", "--hidden", "--effect", "backlash"], "--hidden"),
        (["--protocol", "rich", "--practice", "--effect", "backlash"], "--practice picks"),
        (["--protocol", "rich", "--phase", "on_air"], "--phase"),
        (["--trajectory", "{}"], "--phase"),
        (["--trajectory", "{", "--phase", "on_air"], "not JSON"),
        (["--trajectory", '{"kind": "hop", "amplitude_deg": 3}', "--phase", "on_air"], "kind"),
        (["--trajectory", '{"kind": "sine"}', "--phase", "on_air"], "amplitude_deg"),
        (["--protocol", "rich", "--preset", "nowhere.toml"], "preset"),
    ],
)
def test_bad_requests_get_one_sentence_and_write_nothing(
    tmp_path: Path, arguments: list[str], words: str
) -> None:
    result = CliRunner().invoke(simulate, [*arguments, "--out", str(tmp_path / "x.h5")])
    assert isinstance(result.exception, UserError)
    assert words in str(result.exception)
    assert not list(tmp_path.iterdir())


def test_presets_are_checked() -> None:
    with pytest.raises(UserError, match="not TOML"):
        parse_preset("[", "mine")
    with pytest.raises(UserError, match="unknown section 'glue'"):
        parse_preset("[glue]\nx = 1", "mine")
    with pytest.raises(UserError, match=r"arms\.extension"):
        parse_preset("[arms]\nextension = [1.0]", "mine")


def test_phase_and_cable_must_go_together() -> None:
    wave = {"kind": "sine", "amplitude_deg": 5.0}
    with pytest.raises(UserError, match="phase"):
        single_run(wave, "asleep")
    with pytest.raises(UserError, match="motor alone moves no cable"):
        single_run(wave, "motor_bench", "flexion")
    with pytest.raises(UserError, match="moves by a cable"):
        single_run(wave, "on_air", "none")
    with pytest.raises(UserError, match="flexion cable"):
        single_run(wave, "contact", "extension")
    with pytest.raises(UserError, match="hangs on the motor alone"):
        single_run({**wave, "load_torque": 0.05}, "contact")


@pytest.mark.parametrize("told", ['{"population": true}', '{"effects": ["delay"]}', '{"effects": {"a": 1}}'])
def test_a_simulation_that_names_no_effects_is_told_in_a_sentence(tmp_path: Path, told: str) -> None:
    path = tmp_path / "told.h5"
    made = CliRunner().invoke(
        simulate,
        ["--trajectory", json.dumps(SHORT[0].trajectory), "--phase", "on_air", "--cable", "extension",
         "--out", str(path)],
    )  # fmt: skip
    assert made.exit_code == 0, made.output
    with h5py.File(path, "r+") as file:
        file.attrs["simulation"] = told
    result = CliRunner().invoke(reveal, [str(path)])
    assert isinstance(result.exception, UserError)
    assert "does not say with which effects" in str(result.exception)

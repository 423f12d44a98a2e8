"""A device of one's own by its file: recorded from like any other, and told what is wrong with it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import fingerlab.acquisition.bench.process_bench
from fingerlab.acquisition.bench.process_bench import InlineBench, ProcessBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.cli.main import cli
from fingerlab.core.errors import UserError
from fingerlab.devices.choosing import OWN, choose_device, confirm, confirmed_files, device_file
from fingerlab.rig.file import default_rig
from fingerlab.rig.limits import Limits
from fingerlab.sessions import open_session

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "own_device_example.py"
DAMPING, INERTIA = 1.0e-3, 2.6e-4  # of the example, N m s/rad and kg m^2


@pytest.fixture
def unpaced(tmp_path: Path) -> Path:
    """The example without waiting for the clock."""
    text = EXAMPLE.read_text(encoding="utf-8")
    waits = next(line for line in text.splitlines() if "time.sleep(" in line)
    path = tmp_path / "my_device.py"
    path.write_text(text.replace(waits, "        pass"), encoding="utf-8")
    return path


def test_a_session_is_recorded_and_holds_the_rotor_s_equation(
    unpaced: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """torque = J acceleration + B speed: what the file computes is what the session holds, SI."""

    def inline(choice, settings, rescue, rate_hz):  # type: ignore[no-untyped-def]
        assert (choice.kind, rate_hz) == (OWN, 1000.0)
        return InlineBench(choice.build(), settings, rescue)

    monkeypatch.setattr(fingerlab.acquisition.bench.process_bench, "ProcessBench", inline)
    out = tmp_path / "rotor.h5"
    wave = '{"kind": "sine", "amplitude_deg": 30, "frequency_hz": 1, "offset_deg": 40, "duration_s": 5}'
    words = ["--trajectory", wave, "--phase", "motor_bench", "--out", str(out)]
    command = ["record", "--device", f"own:{unpaced}", *words]
    with pytest.raises(UserError, match="--yes is for the simulated rig"):
        CliRunner().invoke(cli, [*command, "--yes"], catch_exceptions=False)
    with pytest.raises(UserError, match="Nobody is there to say that the bench has been changed"):
        CliRunner().invoke(cli, command, catch_exceptions=False)
    done = CliRunner().invoke(cli, command, catch_exceptions=False, input="\n")
    assert done.exit_code == 0, done.output
    run = open_session(out).runs[0]
    assert run.cable == "none"
    position = run.channel("motor_position")
    assert np.ptp(position[2000:]) == pytest.approx(np.radians(60.0), rel=0.05)
    steps = slice(2000, 4000)  # two periods behind the ramp
    w = 2 * np.pi * np.arange(2000) / 1000.0
    waves = np.stack((np.sin(w), np.cos(w)))
    angle, torque = (2 * waves @ v[steps] / 2000 for v in (position, run.channel("motor_torque")))
    sent = complex(*torque) / complex(*angle)  # of one frequency: B i w - J w^2, up to the sign of i
    assert sent.real == pytest.approx(-INERTIA * (2 * np.pi) ** 2, rel=0.05)
    assert abs(sent.imag) == pytest.approx(DAMPING * 2 * np.pi, rel=0.05)


def test_who_wants_an_effect_does_not_drive_a_motor(unpaced: Path, tmp_path: Path) -> None:
    words = ["--protocol", "motor-bench", "--effect", "coulomb_friction", "--out", str(tmp_path / "s.h5")]
    with pytest.raises(UserError, match="give --device simulated"):
        CliRunner().invoke(cli, ["record", "--device", f"own:{unpaced}", *words], catch_exceptions=False)


@pytest.mark.parametrize(
    ("line", "process"),
    [
        ("        self.make_safe()\n\n    def start", "fingerlab-loop"),
        ("        self._angle =", "fingerlab-recorder"),
    ],
)
def test_a_device_that_fails_in_the_loop_or_as_guardian_is_not_driven(
    unpaced: Path, tmp_path: Path, line: str, process: str
) -> None:
    """The guardian stops the motor when the loop dies: where there is none, there is no bench."""
    fails = (
        f"        if multiprocessing.current_process().name == {process!r}:\n"
        "            raise OSError('the port is\\nin use')\n"
    )
    text = unpaced.read_text(encoding="utf-8")
    assert text.count(line) == 1
    unpaced.write_text(
        text.replace(line, fails + line).replace("import math\n", "import math\nimport multiprocessing\n"),
        encoding="utf-8",
    )
    choice = choose_device(f"own:{unpaced}")
    settings = LoopSettings(BenchUnits.from_rig(default_rig()), Limits())
    with pytest.raises(UserError, match="OSError: the port is in use") as told:
        ProcessBench(choice, settings, tmp_path / "rescued")
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x = 1\n", "it holds none"),
        ("import nowhere_at_all\n", "cannot be run: ModuleNotFoundError"),
        ("this is no Python", "cannot be run: SyntaxError"),
        ("raise SystemExit(7)\n", "cannot be run: SystemExit: 7"),
        (EXAMPLE.read_text(encoding="utf-8") + "\n\nclass Other(Rotor):\n    pass\n", "Other, Rotor"),
        (EXAMPLE.read_text(encoding="utf-8").replace("1000.0", "500.0"), "runs at 500 Hz"),
        (EXAMPLE.read_text(encoding="utf-8").replace("rate_hz", "rate"), "no name or no rate_hz"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_one_sentence(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "device.py"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=told):
        choose_device(f"own:{path}")


def test_what_a_file_prints_is_no_result(unpaced: Path, capsys: pytest.CaptureFixture[str]) -> None:
    unpaced.write_text(f"{unpaced.read_text(encoding='utf-8')}\nprint('hello')\n", encoding="utf-8")
    choose_device(f"own:{unpaced}")
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "hello\n")


def test_each_content_is_confirmed_once(
    unpaced: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    first = device_file(unpaced)
    assert (first.state, confirmed_files()) == ("waiting", ())
    confirm(first)
    assert device_file(unpaced).state == "trusted"
    other = tmp_path / "other.py"
    other.write_text("x = 1\n", encoding="utf-8")
    confirm(device_file(other))
    assert confirmed_files() == (other, unpaced)  # the latest first
    other.unlink()
    assert confirmed_files() == (unpaced,)
    unpaced.write_bytes(first.content + b"\n")
    assert device_file(unpaced).state == "changed"
    unpaced.write_bytes(first.content)
    assert device_file(unpaced).state == "trusted"
    (tmp_path / "settings" / "own-devices.json").write_text("{", encoding="utf-8")
    with pytest.raises(UserError, match="choose your own device anew"):
        device_file(unpaced)


def test_what_was_confirmed_is_listed_and_forgotten(
    unpaced: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the command: one file, even one that is gone, then all; other files stay as they were."""

    def call(*arguments: object) -> Result:
        return CliRunner().invoke(cli, ["devices", *map(str, arguments)])

    def listed() -> dict[str, str]:
        told = json.loads(call("--json", "-").stdout)
        assert [one["name"] for one in told["devices"]][-1] == "simulated"
        return {one["file"]: one["state"] for one in told["own_files"]}

    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    assert "No device of your own was confirmed." in call().stdout
    others = [tmp_path / "gone.py", tmp_path / "other.py"]
    for path in others:
        path.write_text(f"# {path.name}\n", encoding="utf-8")
    for path in (*others, unpaced):
        confirm(device_file(path))
    unpaced.write_text(unpaced.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    others[0].unlink()
    assert listed() == {str(unpaced): "changed", str(others[1]): "confirmed", str(others[0]): "missing"}
    assert call("--untrust", others[0]).exit_code == 0
    assert "never confirmed" in str(call("--untrust", others[0]).exception)
    assert list(listed()) == [str(unpaced), str(others[1])]
    assert call("--untrust", unpaced).exit_code == 0
    assert device_file(unpaced).state == "waiting"
    assert "leave out" in str(call("--untrust", others[1], "--forget").exception)
    assert device_file(others[1]).state == "trusted"
    assert call("--forget").exit_code == 0
    assert listed() == {}


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="does not exist"):
        choose_device(f"own:{tmp_path / 'none.py'}")
    with pytest.raises(UserError, match="give own:FILE"):
        choose_device("own:")

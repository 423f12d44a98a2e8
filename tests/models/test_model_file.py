"""Model files: what goes in comes out; what is not one is told in a sentence."""

from __future__ import annotations

import hashlib
import json
import math
from datetime import datetime
from pathlib import Path

import pytest

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.models.file import (
    ParameterEstimate,
    SavedModel,
    SessionHash,
    hash_sessions,
    load_model,
    save_model,
)
from fingerlab.sessions import open_session

MODEL = SavedModel(
    "regions",
    {
        "extension/pip/flexion/moment_arm": ParameterEstimate(0.0072, "m", 0.0070, 0.0074),
        "coulomb_friction/torque": ParameterEstimate(0.0048, "N m", math.nan, math.nan),
    },
    (SessionHash("S.h5", "ab" * 32),),
    effects=("coulomb_friction",),
    details={"delay": "none", "r2": {"a": 0.5, "b": math.nan}},
)


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "M.json"
    save_model(MODEL, path)
    back = load_model(path)
    assert back.parameters["extension/pip/flexion/moment_arm"] == ParameterEstimate(
        0.0072, "m", 0.0070, 0.0074
    )
    assert math.isnan(back.parameters["coulomb_friction/torque"].low)
    assert (back.method, back.effects, back.sessions) == (MODEL.method, MODEL.effects, MODEL.sessions)
    assert back.details == {"delay": "none", "r2": {"a": 0.5, "b": None}}
    assert back.software == f"fingerlab {fingerlab.__version__}"
    assert datetime.fromisoformat(back.created).utcoffset() is not None
    assert not list(tmp_path.glob("*.part"))


def test_hash_is_of_the_files_bytes(make_session) -> None:
    path = make_session()
    (found,) = hash_sessions([open_session(path)])
    assert found == SessionHash(path.name, hashlib.sha256(path.read_bytes()).hexdigest())


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "M.json"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(UserError, match="exists already"):
        save_model(MODEL, path)
    assert path.read_text(encoding="utf-8") == "mine"
    with pytest.raises(UserError, match="folder"):
        save_model(MODEL, tmp_path / "absent" / "M.json")


def _broken(**changes: object) -> str:
    good = {
        "format": "fingerlab-model",
        "format_version": "1",
        "software": "fingerlab 0.1.0",
        "created": "2026-11-01T09:00:00+01:00",
        "method": "regions",
        "sessions": [],
        "parameters": {},
    }
    return json.dumps({k: v for k, v in {**good, **changes}.items() if v is not None})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{ not json", "not JSON"),
        ("[1, 2]", "not a JSON object"),
        ("\xff\xfe", "give a model file"),
        (json.dumps({"model": "linear", "coef": [1, 2]}), "not a FingerLab model file"),
        (_broken(format="other-software"), "not a FingerLab model file"),
        (_broken(format_version="2"), "newer FingerLab"),
        (_broken(format_version="x"), "format_version"),
        (_broken(parameters=None), "lacks 'parameters'"),
        (_broken(effects=1e-308), "lacks 'effects'"),
        (_broken(method=3), "lacks 'method'"),
        (_broken(sessions=[{"name": "S.h5"}]), "'sha256'"),
        (_broken(parameters={"p": {"value": "1", "unit": "m", "low": 0, "high": 1}}), "parameter 'p'"),
        (_broken(parameters={"p": {"value": 1.0, "low": 0, "high": 1}}), "parameter 'p'"),
        (_broken(parameters={"p": {"value": 1.0, "unit": "m"}}), "parameter 'p'"),
        (_broken(details=[]), "lacks 'details'"),
    ],
)
def test_what_is_not_a_model_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "M.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(UserError, match=words) as caught:
        load_model(path)
    assert "\n" not in str(caught.value)
    assert "M.json" in str(caught.value)


def test_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="does not exist"):
        load_model(tmp_path / "M.json")
    with pytest.raises(UserError):
        load_model(tmp_path)


def test_later_minor_version_is_read(tmp_path: Path) -> None:
    path = tmp_path / "M.json"
    path.write_text(_broken(format_version="1.4", added_later=True), encoding="utf-8")
    assert load_model(path).method == "regions"

"""Opening ten hours costs no more memory than opening ten seconds; checking reads in pieces."""

from __future__ import annotations

import json
import subprocess
import sys
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

RATE = 1000
CHUNK = 16384

MEASURE = """
import gc, json, os, sys, tracemalloc, psutil
from fingerlab.sessions import check_session, open_session
open_session(sys.argv[2])          # everything is imported and HDF5 is awake
gc.collect()
process = psutil.Process()
before = process.memory_info().rss
tracemalloc.start()
session = open_session(sys.argv[1])
if sys.argv[3] == "check":
    assert not check_session(session).errors
peak = tracemalloc.get_traced_memory()[1]
rss = process.memory_info().rss - before
print(json.dumps({"peak": peak, "rss": rss, "samples": session.runs[0].length}))
"""


def measure(path: Path, warm_up: Path, what: str) -> dict[str, int]:
    command = [sys.executable, "-c", MEASURE, str(path), str(warm_up), what]
    result = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    return json.loads(result.stdout)


def lengthen(file: h5py.File, samples: int) -> None:
    """Give run 001 channels of any length without compressing each of their chunks anew.

    One compressed chunk is written again and again, so that the file has the chunk index of a real one.
    """
    group = file["runs/001"]
    values = np.zeros(CHUNK)
    values[:512] = np.random.default_rng(1).random(512)  # no recording is packed into next to nothing
    packed = zlib.compress(values.tobytes(), 1)
    for name in list(group):
        unit = group[name].attrs["units"]
        del group[name]
        shape = {"shape": (samples,), "dtype": np.float64, "chunks": (CHUNK,)}
        dataset = group.create_dataset(name, compression="gzip", compression_opts=1, **shape)
        dataset.attrs["units"] = unit
        for start in range(0, samples, CHUNK):
            dataset.id.write_direct_chunk((start,), packed)


@pytest.fixture
def ten_seconds(make_session):
    run = (("on_air", "extension"),)
    return make_session("short.h5", lambda file: lengthen(file, 10 * RATE + CHUNK), run)


def test_ten_hours_open_in_the_memory_of_ten_seconds(make_session, ten_seconds):
    samples = 10 * 3600 * RATE
    run = (("on_air", "extension"),)
    ten_hours = make_session("long.h5", lambda file: lengthen(file, samples), run)
    short, long = measure(ten_seconds, ten_seconds, "open"), measure(ten_hours, ten_seconds, "open")
    assert long["samples"] == samples
    # One channel alone is 288 MB in memory.
    assert long["peak"] < short["peak"] + 50_000
    assert long["rss"] < short["rss"] + 4_000_000


def test_checking_an_hour_stays_small(tmp_path, make_session, ten_seconds):
    samples = 3600 * RATE

    def write(file):
        group = file["runs/001"]
        for name in list(group):
            del group[name]
        for name, unit in (("time", "s"), ("motor_position", "rad"), ("motor_torque", "N m")):
            values = np.arange(samples) / RATE if name == "time" else np.zeros(samples)
            group.create_dataset(name, data=values, chunks=(CHUNK,)).attrs["units"] = unit

    path = make_session("hour.h5", write, (("motor_bench", "none"),))
    # Three channels of an hour are 86 MB; the pieces that are looked at together are about 3 MB.
    assert measure(path, ten_seconds, "check")["peak"] < 20_000_000

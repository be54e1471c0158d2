"""``smolux sweep``, and ``[parallel]`` and ``target_error`` in case files."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command import call

import smolux
from shared import KERNEL
from smolux import results

CASE = f"""\
{KERNEL}\
[[processes]]
name = "aggregation"
[[processes]]
name = "shattering"
rate = 0.1
[run]
times = [5, 20]
particles = 20000
replicas = 2
seed = 11
sizes = 32
method = "acceptance-rejection"
[output]
figures = []
report = false
"""
OVER = ("--over", "processes.shattering.rate=0.1:0.6:6")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.toml").write_text(CASE)
    return tmp_path


def points(folder: Path) -> dict[str, int]:
    return {p.name: p.stat().st_mtime_ns for p in folder.glob("points/0*.nc")}


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="signals of POSIX")
@pytest.mark.slow
def test_killed_in_the_middle_and_gone_on_with(folder):
    command = [sys.executable, "-m", "smolux", "sweep", "c.toml", *OVER, "-o", "cut"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 240
    while len(points(folder / "cut")) < 2 and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.kill()
    process.communicate()
    kept = points(folder / "cut")
    assert 2 <= len(kept) <= 6
    assert process.returncode == -signal.SIGKILL
    assert not (folder / "cut" / "results.nc").exists()
    result = call("sweep", "cut")
    assert points(folder / "cut").items() >= kept.items()  # none of them is done again
    assert len(points(folder / "cut")) == 6
    assert "all points are in cut/results.nc" in result.stderr
    whole = smolux.sweep("c.toml", OVER[1:], directory="whole")
    found = results.load(folder / "cut" / "results.nc")
    assert whole.drop_vars("point_seconds").equals(found.drop_vars("point_seconds"))


def test_a_table_and_what_failed(folder):
    over = "processes.shattering.rate=0.1*(1 - t),0.1"
    result = call("sweep", "c.toml", "--over", over, "-s", "run.particles=150", code=2)
    rows = [line.split() for line in result.stdout.splitlines()]
    assert rows[-2][-7:] == ["-"] * 6 + ["failed"]
    assert rows[-1][0] == "0.1"
    assert len(rows[-1]) == 7
    errors = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert errors[0].startswith("error: processes.shattering.rate = 0.1*(1 - t): ")
    assert "must not be negative" in errors[0]
    assert errors[1] == "error: 1 points failed; try them again with: smolux sweep c-sweep"
    assert call("show", "c-sweep").stdout.strip() == result.stdout.strip()


def test_mistakes(folder):
    result = call("sweep", "c.toml", "--over", "run.seeed=1,2", code=2)
    assert "no such key" in result.stderr
    assert "did you mean 'seed'" in result.stderr
    assert "nothing to sweep over" in call("sweep", "c.toml", code=2).stderr
    assert "cannot be read" in call("sweep", "none.toml", "--over", "a.b=1", code=2).stderr
    (folder / "empty").mkdir()
    assert "there is no sweep.toml" in call("sweep", "empty", code=2).stderr
    assert "without options" in call("sweep", "empty", "--over", "a.b=1", code=2).stderr
    assert sorted(p.name for p in folder.iterdir()) == ["c.toml", "empty"]


# --- more of the case file ------------------------------------------------------------------------


def test_a_target_error(folder):
    result = call(
        "run", "c.toml", "-s", "run.particles=150", "-s", "run.replicas=8", "-o", "r",
        "-s", "run.target_error=0.05", "-s", "run.target=M2", "-s", "run.max_replicas=400",
    )  # fmt: skip
    ds = results.load(folder / "r" / "results.nc")
    assert ds.sizes["replica"] > 8
    assert f"{ds.sizes['replica']} replicas" in result.stdout
    assert ds.attrs["reached_error"] <= 0.05
    call("run", "r")  # what is finished stays finished
    again = results.load(folder / "r" / "results.nc")
    assert again.identical(ds)
    text = call("run", "c.toml", "-s", "run.target_error=2", "-o", "q", code=2).stderr
    assert "target_error = 2: must be a number between 0 and 1" in text
    assert "replicas = 2: with target_error at least 8" in text


@pytest.mark.slow
def test_processes(folder):
    call(
        "run", "c.toml", "-s", "parallel.executor=processes", "-s", "parallel.workers=2", "-o", "p"
    )
    call("run", "c.toml", "-s", "parallel.workers=1", "-o", "t")
    one, other = (results.load(folder / name / "results.nc") for name in "pt")
    assert one.equals(other)
    assert "[parallel]" in (folder / "p" / "case.toml").read_text()
    assert "parallel     executor" in call("check", "p/case.toml").stdout


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        (["parallel.executor=thread"], "did you mean 'threads'"),
        (["parallel.address=tcp://x:1"], 'is only for executor = "dask"'),
        (["parallel.workers=0"], "whole number"),
        (["parallel.executor=processes", "run.time_limit=5"], "needs threads"),
        (["parallel.executor=dask", "parallel.address=a", "parallel.workers=2"], "take this line"),
        (["parallel.nodes=2"], "no such key"),
    ],
)
def test_mistakes_in_parallel(folder, sets, words):
    options = [part for text in sets for part in ("-s", text)]
    result = call("run", "c.toml", *options, code=2)
    assert words in result.stderr
    assert np.all([p.name == "c.toml" for p in folder.iterdir()])

"""The command line as a program of its own: start, signals, pipes, exit codes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command import call

from shared import KERNEL
from smolux import results

HEAVY = ("numba", "xarray", "matplotlib", "scipy", "pint", "pandas", "rich", "numpy")

LONG = f"""\
{KERNEL}\
[[processes]]
name = "aggregation"
[[processes]]
name = "shattering"
rate = 0.1
[run]
times = [0, 10, 50, 150]
particles = 300000
replicas = 3
checkpoint_every = 0.2
seed = 11
sizes = 64
method = "acceptance-rejection"
[output]
figures = []
"""


def start(*arguments: str, cwd: Path | None = None) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "smolux", *arguments],
        cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"COLUMNS": "80"},
    )  # fmt: skip


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=240)
    return process.returncode, out, err


def test_help_loads_nothing_heavy_and_answers_at_once():
    code = (
        "import sys\nfrom smolux.cli.app import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        f"sys.exit(', '.join(m for m in {HEAVY!r} if m in sys.modules) or 0)"
    )
    begun = time.process_time()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Commands:" in done.stdout
    # processor time of the child, which a busy machine does not stretch
    spent = os.times().children_user + os.times().children_system
    assert time.process_time() - begun < 5
    before = spent
    subprocess.run([sys.executable, "-m", "smolux", "--help"], capture_output=True, check=True)
    assert os.times().children_user + os.times().children_system - before < 0.8


def test_mistakes_end_with_2_and_no_traceback(tmp_path):
    (tmp_path / "bad.toml").write_text('[kernel]\nname = "konstant"\n[run]\ntimes = [1]\n')
    code, out, err = finish(start("run", "bad.toml", cwd=tmp_path))
    assert (code, out) == (2, "")
    (line,) = err.splitlines()
    assert line.startswith('error: bad.toml, line 2: kernel.name = "konstant": is unknown')
    assert line.endswith("did you mean 'constant'?")
    assert not (tmp_path / "bad").exists()


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the result of a run without a stop."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "long.toml").write_text(LONG)
    call("run", folder / "long.toml", "-o", folder / "long")
    return results.load(folder / "long" / "results.nc")


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    "number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.slow)]
)
def test_a_signal_stops_without_loss(tmp_path, number, whole):
    (tmp_path / "long.toml").write_text(LONG)
    process = start("run", "long.toml", "-o", "cut", cwd=tmp_path)
    checkpoint, before, stopped = tmp_path / "cut" / "checkpoint.npz", 0, 0
    for _ in range(2):  # once in the first run, once after it went on
        while process.poll() is None and before == (before := written(checkpoint, before)):
            time.sleep(0.02)
        process.send_signal(number)
        code, _, err = finish(process)
        assert "Traceback" not in err
        if code == 3:
            assert err.splitlines()[-1] == "go on with: smolux run cut"
            ds = results.load(tmp_path / "cut" / "results.nc")
            if not ds.attrs["complete"]:  # else it came when only figures were missing
                stopped += 1
                assert checkpoint.is_file()
                before = written(checkpoint, 0)
        process = start("run", "cut", cwd=tmp_path)
    code, _, err = finish(process)
    assert code == 0, err
    assert stopped >= 1
    second = results.load(tmp_path / "cut" / "results.nc")
    assert whole.equals(second)
    assert second.attrs["complete"]


def written(file: Path, before: int) -> int:
    """When a file was written, or `before` if it is not there."""
    try:
        return file.stat().st_mtime_ns
    except FileNotFoundError:
        return before


@pytest.mark.slow
def test_a_killed_run_starts_again_with_its_seed(tmp_path):
    (tmp_path / "c.toml").write_text(LONG.replace("seed = 11\n", ""))
    process = start("run", "c.toml", "-s", "run.particles=2e3", cwd=tmp_path)
    while not (tmp_path / "c" / "case.toml").exists():
        time.sleep(0.02)
    process.kill()
    finish(process)
    seed = next(
        line for line in (tmp_path / "c" / "case.toml").read_text().splitlines() if "seed" in line
    )
    code, _, err = finish(start("run", "c", cwd=tmp_path))
    assert code == 0, err
    assert f"seed {seed.split()[-1]}" in err
    assert results.load(tmp_path / "c" / "results.nc").attrs["seed"] == seed.split()[-1]


def test_output_goes_to_its_streams_and_has_no_control_characters(tmp_path):
    (tmp_path / "c.toml").write_text(LONG)
    code, out, err = finish(start("run", "c.toml", "-s", "run.particles=1000", cwd=tmp_path))
    assert code == 0
    assert "\x1b" not in out + err
    assert "\r" not in out + err
    assert "seed 11, folder c" in err
    assert "simulated in" in err
    assert "compiling" in err
    assert "M2" in out
    assert "seed 11" in out


def test_a_reader_that_leaves_is_no_error():
    process = start("kernels")
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait(timeout=60) == 0
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()

"""Discs in a box on the command line."""

from __future__ import annotations

import numpy as np
import pytest
from command import call

from smolux import results
from smolux.case import load, spatial
from smolux.errors import InputError, SmoluxWarning
from smolux.spatial import lognormal_radii, random, simulate, simulation

CASE = """\
title = "few discs"
[spatial]
discs = 36
volume_fraction = 0.3
seed = 2
[output]
figures = ["discs"]
trajectory = "xyz"
frames = 2
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "few.toml").write_text(CASE)
    return tmp_path


def test_a_case_from_run_to_movie(folder):
    assert "36 discs" in call("check", "few.toml").stdout
    run = call("run", "few.toml")
    assert "35 merges" in run.stdout
    for name in ("case.toml", "results.nc", "discs.png", "trajectory.xyz"):
        assert (folder / "few" / name).is_file()
    tree = results.load(folder / "few" / "results.nc")
    assert tree.attrs["seed"] == 2
    assert tree.attrs["title"] == "few discs"
    assert spatial.load(folder / "few" / "case.toml") == spatial.load("few.toml")
    assert call("show", "few").stdout == run.stdout
    before = (folder / "few" / "results.nc").read_bytes()
    assert call("run", "few").stdout == run.stdout
    assert (folder / "few" / "results.nc").read_bytes() == before
    call("plot", "few", "-k", "coarsening", "-o", "n.pdf")
    assert (folder / "n.pdf").is_file()
    assert "did you mean 'discs'" in call("plot", "few", "-k", "disks", code=2).stderr
    call("movie", "few", "-n", "2", "-p", "64")
    assert (folder / "few" / "movie.gif").is_file()


def test_the_time_limit_stops_and_goes_on(folder, monkeypatch):
    monkeypatch.setattr(simulation, "_BUDGET", 20)
    (folder / "cut.toml").write_text(CASE.replace("seed = 2", "seed = 2\ntime_limit = 1e-9"))
    stderr = call("run", "cut.toml", code=3).stderr
    assert "the time limit of 1e-09 s is reached; what was reached is in cut" in stderr
    assert "go on with: smolux run cut" in stderr
    before = results.load(folder / "cut" / "results.nc")["events"].sizes["event"]
    assert before <= 20
    call("run", "cut", code=3)
    assert results.load(folder / "cut" / "results.nc")["events"].sizes["event"] > before


def test_a_case_in_three_dimensions_without_a_seed_gets_one(folder):
    sets = ("--set", "spatial.dimension=3", "--set", "spatial.discs=27")
    text = call("check", "few.toml", *sets).stdout
    assert "27 spheres" in text
    case = spatial.load("few.toml", ["spatial.walls=periodic", "spatial.initial=random"])
    assert case.run.walls == ("periodic",)
    assert case.with_seed() is case
    (folder / "new.toml").write_text(CASE.replace("seed = 2\n", ""))
    assert spatial.load("new.toml").with_seed().run.seed is not None


def test_every_setting_arrives(folder):
    settings = {
        "discs": 27, "dimension": 3, "initial": "random", "volume_fraction": 0.05, "seed": 4,
        "walls": "periodic", "velocities": "maxwellian", "temperature": 2.5, "radius_sigma": 1.3,
        "until": 3.0, "clusters": 2, "max_events": 7, "time_limit": 60.0,
    }  # fmt: skip
    run = spatial.load("few.toml", [f"spatial.{k}={v}" for k, v in settings.items()]).run
    known = random(
        27, 0.05, dimension=3, radii=lognormal_radii(1.3), walls="periodic",
        velocities="maxwellian", temperature=2.5, seed=4,
    )  # fmt: skip
    made = run.system()
    for name in ("position", "velocity", "radius", "mass"):
        np.testing.assert_array_equal(getattr(made, name), getattr(known, name))
    assert made.box == known.box
    given = run.arguments()
    for name in ("until", "clusters", "max_events", "time_limit"):
        assert given[name] == settings[name]


def test_all_mistakes_at_once_with_their_lines(folder):
    (folder / "bad.toml").write_text(
        '[spatial]\ndisc = 36\nwalls = "sticky"\nmethod = "windowde"\nradius_sigma = 1.5\n'
        '[output]\nfigures = ["disks"]\n[kernel]\n'
    )
    lines = call("run", "bad.toml", code=2).stderr.splitlines()
    for line, words in (
        (1, "spatial.discs is missing"),
        (2, "spatial.disc: no such key; did you mean 'discs'?"),
        (3, 'spatial.walls = "sticky"'),
        (4, "did you mean 'windowed'"),
        (5, "on a lattice all discs are equal"),
        (7, "output.figures"),
        (8, "kernel: no such key"),
    ):
        assert any(f"bad.toml, line {line}:" in text and words in text for text in lines), words
    with pytest.raises(InputError, match="a case in space can be run and checked"):
        load("few.toml")


def test_a_limit_is_told(folder):
    call("run", "few.toml", "--set", "spatial.max_events=5", "-o", "cut")
    assert "limit of 5 events" in call("show", "cut").stdout


def test_what_was_interrupted_goes_on(folder):
    whole = call("run", "few.toml").stdout
    file = folder / "few" / "results.nc"
    case = results.load(file).attrs["case"]
    with pytest.warns(SmoluxWarning, match="the limit of 20 events"):
        part = simulate(spatial.load("few.toml").run.system(), max_events=20)
    part.attrs |= {"stopped": "interrupted", "case": case}
    results.save(part, file)
    again = call("run", "few")
    assert "going on at t = " in again.stderr
    assert "35 merges" in again.stdout
    assert again.stdout.splitlines()[-1] == whole.splitlines()[-1]
    before = file.read_bytes()
    call("run", "few")
    assert file.read_bytes() == before


STEPS = ("--set", "spatial.method=time-stepping", "--set", "spatial.step=0.3")


def test_time_steps_need_times_and_have_settings_of_their_own(folder):
    case = spatial.load("few.toml", [*STEPS[1::2], "spatial.times=[1, 10]", "spatial.rigid=true"])
    given = case.run.arguments()
    assert (given["method"].step, given["method"].rigid) == (0.3, True)
    assert given["times"] == (1.0, 10.0)
    (folder / "steps.toml").write_text(case.to_toml())
    assert spatial.load("steps.toml") == case
    assert "spatial.times is missing" in call("check", "few.toml", *STEPS, code=2).stderr
    for change, words in (
        ("spatial.step=0.7", "must lie above 0 and be 0.5 at most"),
        ('spatial.times=["1 s"]', "a box has no units"),
        ("spatial.times=[2, 1]", "must ascend"),
    ):
        mistakes = call("check", "steps.toml", "--set", change, code=2).stderr
        assert words in mistakes, change
    assert (
        "only the method" in call("check", "few.toml", "--set", "spatial.step=0.3", code=2).stderr
    )


@pytest.mark.slow
def test_a_run_by_time_steps(folder):
    run = call("run", "few.toml", *STEPS, "--set", "spatial.times=[0, 1, 2]", "-o", "steps")
    assert "35 merges" in run.stdout
    assert "no trajectory.xyz" in run.stderr  # its log does not determine the motion
    assert (folder / "steps" / "discs.png").is_file()
    tree = results.load(folder / "steps" / "results.nc")
    assert tree["series/clusters"].values[0] == 36
    assert '"step": 0.3' in tree.attrs["method_settings"]
    assert call("show", "steps").stdout == run.stdout
    call("plot", "steps", "-k", "pair-distribution", "-k", "box-dimension")

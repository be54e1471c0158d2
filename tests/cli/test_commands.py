"""Every command, in process."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr
from command import call

import smolux
from smolux.case import load, parse, spatial
from smolux.cli import app, cautions
from smolux.cli.commands import compare, kernels, new, show
from smolux.errors import InputError, OutOfMemoryError, WorkerError
from smolux.kernels import KERNELS

SMALL = """\
title = "small"
[kernel]
name = "constant"
[run]
times = [0.5, 1]
particles = 500
replicas = 3
seed = 7
sizes = 32
method = "acceptance-rejection"
[output]
figures = []
"""

DRAWN = SMALL.replace("figures = []", "")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SMALL)
    return tmp_path


def test_help_names_every_command():
    text = call("--help").stdout
    for name, summary in app.COMMANDS.items():
        assert f"  {name} " in text
        assert summary in text  # not cut off
    assert "--version" in text
    assert call("--version").stdout == f"smolux {smolux.__version__}\n"


def test_a_misspelt_command_is_a_mistake_of_the_user():
    for wrong in (("rnu", "x"), ("run",)):
        assert "Traceback" not in call(*wrong, code=2).stderr


# --- kernels ---------------------------------------------------------------------------------


def test_kernels_lists_every_law():
    text = call("kernels").stdout
    for law in KERNELS:
        assert law.name in text


@pytest.mark.parametrize("law", KERNELS, ids=lambda law: law.name)
def test_details_give_a_table_that_a_case_file_takes(law):
    text = call("kernels", law.name).stdout
    assert law.formula in text
    assert law.reference in text
    tables = text.split("    [kernel]\n")[1:]
    assert len(tables) == 1 + len(law.constructors)
    for number, table in enumerate(tables):
        lines = [line.strip() for line in table.split("\n\n")[0].splitlines()]
        units = number > 0
        case = "[kernel]\n" + "\n".join(lines) + "\n[initial]\ndensity = "
        case += '"1 m^-3"\n[run]\ntimes = ["1 s"]\n' if units else "1\n[run]\ntimes = [1]\n"
        assert isinstance(parse(case).model.kernel, law)


def test_an_unknown_kernel_is_named_with_the_nearest():
    assert "did you mean 'ballistic'" in call("kernels", "balistic", code=2).stderr


def test_what_gels_says_when():
    rows = {row[0]: row for row in kernels.overview()}
    assert rows["multiplicative"][2] == "at t = 1"
    assert rows["constant"][1:4] == ("0", "no", "yes")


# --- new -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", new.TEMPLATES)
def test_every_template_is_a_commented_case_that_can_be_run(name, folder):
    call("new", "mine", "--template", name)
    text = (folder / "mine.toml").read_text()
    assert text.count("#") >= 5
    assert "smolux run mine.toml" in text
    assert "{" not in text.replace("= {", "")
    case = spatial.load("mine.toml") or load("mine.toml")
    assert case.run is not None
    assert case.title


def test_new_never_overwrites(folder):
    call("new", "small", code=2)
    assert (folder / "small.toml").read_text() == SMALL


def test_new_lists_its_templates_and_knows_the_nearest(folder):
    for arguments in (("new",), ("new", "--list")):
        assert all(name in call(*arguments).stdout for name in new.TEMPLATES)
    assert "did you mean 'shattering'" in call("new", "x", "-t", "shatering", code=2).stderr
    assert "there is no folder" in call("new", "none/x", code=2).stderr
    assert not (folder / "x.toml").exists()


# --- run, show, plot -------------------------------------------------------------------------


def test_a_run_leaves_everything_in_its_folder(folder):
    (folder / "small.toml").write_text(DRAWN)
    result = call("run", "small.toml")
    run = folder / "small"
    assert sorted(p.name for p in run.iterdir()) == [
        "case.toml", "clusters.png", "moments.png", "report.html", "results.nc",
        "size-distribution.png",
    ]  # fmt: skip
    ds = smolux.results.load(run / "results.nc")
    assert ds.attrs["seed"] == "7"
    assert "seed 7" in result.stderr
    assert ds.attrs["case"] == (run / "case.toml").read_text()
    assert load(run / "case.toml") == load("small.toml")
    assert "particles = 500" in ds.attrs["case"]
    assert (run / "clusters.png").read_bytes().startswith(b"\x89PNG")
    assert "moment M2" in result.stdout
    assert "constant to rounding" in result.stdout


def test_a_seed_that_is_drawn_is_told_and_repeats_the_run(folder):
    (folder / "small.toml").write_text(SMALL.replace("seed = 7\n", ""))
    call("run", "small.toml")
    seed = tomllib.loads((folder / "small" / "case.toml").read_text())["run"]["seed"]
    call("run", "small.toml", "--set", f"run.seed={seed}", "-o", "again")
    call("run", "small.toml", "-o", "other")
    first, again, other = (
        smolux.results.load(folder / name / "results.nc") for name in ("small", "again", "other")
    )
    assert first.equals(again)
    assert not first.equals(other)


def test_runs_are_never_overwritten(folder):
    call("run", "small.toml")
    call("run", "small.toml")
    assert (folder / "small-2" / "results.nc").is_file()
    assert "holds a run already" in call("run", "small.toml", "-o", "small", code=2).stderr
    (folder / "full").mkdir()
    (folder / "full" / "thesis.tex").write_text("")
    assert "is not empty" in call("run", "small.toml", "-o", "full", code=2).stderr
    assert "is a file" in call("run", "small.toml", "-o", "small.toml", code=2).stderr


def test_a_finished_run_goes_on_to_nothing(folder):
    call("run", "small.toml", "-o", "x")
    before = (folder / "x" / "results.nc").read_bytes()
    (folder / "x" / "report.html").unlink()
    call("run", "x")
    assert (folder / "x" / "results.nc").read_bytes() == before
    assert (folder / "x" / "report.html").is_file()
    assert "goes on as it is" in call("run", "x", "--set", "run.seed=1", code=2).stderr
    assert "not the folder of a run" in call("run", ".", code=2).stderr


def test_a_case_that_was_changed_is_no_case_to_go_on_with(folder):
    call("run", "small.toml", "-o", "x", "-s", "solve.tolerance=1e-5")
    file = folder / "x" / "case.toml"
    text = file.read_text()
    for old, other in (("500", "600"), ("scale = 1.0", "scale = 2.0"), ("1e-05", "1e-06")):
        assert old in text
        file.write_text(text.replace(old, other))
        assert "was changed since the run was begun" in call("run", "x", code=2).stderr
    file.write_text(text.replace("report = true", "report = false"))
    call("run", "x")


def test_a_run_with_the_solver_says_whether_they_agree(folder):
    many = "--set", "solve.tolerance=1e-6", "--set", "run.replicas=8"
    result = call("run", "small.toml", *many)
    assert "The simulation agrees with the solution of the rate equations" in result.stdout
    solution = smolux.results.load(folder / "small" / "solution.nc")
    assert float(solution["number_density"][0, 1]) == pytest.approx(2 / 3, rel=1e-5)


def test_the_solver_alone(folder):
    (folder / "s.toml").write_text(
        '[kernel]\nname = "constant"\nscale = "1 l/s"\n[initial]\ndensity = "1 l^-1"\n'
        '[solve]\ntimes = ["1 s"]\n'
    )
    result = call("run", "s.toml")
    assert "relative difference" in result.stdout
    ds = smolux.results.load(folder / "s" / "results.nc")
    assert float(ds["number_density"][0, 0]) == pytest.approx(1000 * 2 / 3)
    for name, unit in (("time", "s"), ("volume", "m3"), ("moment", "m-3"), ("n", "m-3")):
        assert ds[name].attrs["units"] == unit
    assert not (folder / "s" / "solution.nc").exists()
    assert call("show", "s").stdout == result.stdout


@pytest.mark.slow
def test_a_case_with_units_has_results_with_units(folder):
    call("new", "air", "-t", "aerosol")
    call("run", "air.toml", "-s", "run.particles=500", "-s", "run.replicas=2")
    ds = smolux.results.load(folder / "air" / "results.nc")
    assert ds["time"].attrs["units"] == "s"
    assert ds["moment"].attrs["units"] == "m-3"
    assert ds["volume"].attrs["units"] == "m3"
    assert float(ds["number_density"][0, 0]) == pytest.approx(1e13, rel=0.1)


def test_show_and_plot(folder):
    call("run", "small.toml")
    shown = call("show", "small").stdout
    assert shown == call("show", "small/results.nc").stdout
    assert "exact" in shown
    output = call("plot", "small", "--kind", "scaling").stdout
    assert output.strip() == "small/scaling.png"
    assert (folder / "small" / "scaling.png").is_file()
    call("plot", "small", "-k", "moments", "-o", "m.pdf")
    assert (folder / "m.pdf").read_bytes().startswith(b"%PDF")
    assert "did you mean 'moments'" in call("plot", "small", "-k", "momnets", code=2).stderr
    assert "is one file" in call("plot", "small", "-o", "m.pdf", code=2).stderr
    assert "no such file" in call("show", "nothing.nc", code=2).stderr
    assert "no results.nc" in call("show", ".", code=2).stderr


def test_show_cuts_long_tables(folder):
    call("run", "small.toml", "--set", "run.times={stop=1, count=40}", "-o", "long")
    assert "12 of 40 times are shown" in call("show", "long").stdout
    shown = show.chosen(smolux.results.load(folder / "long" / "results.nc"), 12)["time"].values
    assert (len(shown), shown[0], shown[-1]) == (12, 0.0, 1.0)
    whole = call("show", "long", "--all").stdout
    assert "are shown" not in whole
    assert whole.count("\n") > 80


# --- check, compare, demo --------------------------------------------------------------------


def test_check_tells_the_cost(folder):
    words = ("is valid", "memory", "output", "No warnings")
    quick = call("check", "small.toml").stdout
    whole = call("check", "small.toml", "--cost").stdout
    for word in words:
        assert word in quick
        assert word in whole
    for word in ("collisions   about", "time         about"):
        assert word not in quick
        assert word in whole
    assert "smolux check small.toml --cost" in quick


def test_check_loads_no_compiler():
    """So that it answers at once: for every template without discs."""
    code = (
        "import sys\nfrom smolux.case import parse\nfrom smolux.cli.commands import check, new\n"
        "for name in new.TEMPLATES:\n"
        "    if name != 'ballistic-2d':\n"
        "        assert 'is valid' in check.text(parse(new.text(name)), name)\n"
        "assert not {'numba', 'xarray', 'matplotlib'} & set(sys.modules), sys.modules.keys()\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", app.COMMANDS)
def test_each_command_is_the_function_of_its_module(name):
    command = getattr(importlib.import_module(f"smolux.cli.commands.{name}"), name)
    page = call(name, "--help").stdout
    assert inspect.cleandoc(command.__doc__).splitlines()[0] in " ".join(page.split())


def test_check_tells_all_mistakes_with_lines(folder):
    text = SMALL.replace("constant", "konstant").replace("particles", "particels")
    (folder / "bad.toml").write_text(text.replace("replicas = 3", "replicas = -3"))
    errors = call("check", "bad.toml", code=2).stderr.splitlines()
    assert [e.split(":")[1] for e in errors] == [
        " bad.toml, line 3", " bad.toml, line 6", " bad.toml, line 7",
    ]  # fmt: skip


def test_compare_puts_methods_side_by_side(folder):
    for replicas, words in ((3, "too few replicas"), (8, "agrees")):
        given = "-s", f"run.replicas={replicas}", "-m", "acceptance-rejection", "-m", "solver"
        result = call("compare", "small.toml", *given)
        rows = [line for line in result.stdout.splitlines() if line.startswith(" acc")]
        assert len(rows) == 1
        assert words in rows[0]
    assert "the exact solution" in result.stdout
    assert "no scatter" in result.stdout
    assert "did you mean 'inverse'" in call("compare", "small.toml", "-m", "invers", code=2).stderr


def test_compare_says_the_warnings_of_each_method(folder):
    sets = "run.particles=10", 'run.population="fixed-volume"', "run.times=[1e6]"
    given = [part for one in sets for part in ("-s", one)]
    found = call("compare", "small.toml", "-m", "acceptance-rejection", *given).stderr
    assert "acceptance-rejection: warning: 3 of 3 replicas ended as one cluster" in found


def test_what_is_compared_is_independent_and_alike(folder, monkeypatch):
    """Each method has a seed of its own, and a gel reacts as in a simulation."""
    given = []
    made = xr.Dataset(
        attrs={"complete": 1, "compile_seconds": 2.0, "wall_seconds": 5.0, "events": 9}
    )

    def computed(_: object, *times: object, **settings: object) -> xr.Dataset:
        given.append(settings)
        return made

    monkeypatch.setattr(smolux, "simulate", computed)
    monkeypatch.setattr(smolux, "solve", computed)
    case = load("small.toml", ["kernel.name=multiplicative"])
    found = compare.compute(case, ["inverse", "size-class", "solver"])
    assert [settings.get("seed") for settings in given] == [7, 8, None]
    assert [settings.get("method") for settings in given] == ["inverse", "size-class", None]
    assert given[-1]["gel"] == "reacts"
    # without what it took to compile
    assert [each.seconds for each in found[:2]] == [3.0, 3.0]


def test_methods_share_the_level_of_a_table(monkeypatch):
    test = {"p_value": 0.004, "p_total": 0.5, "p_largest": 1.0, "found_beyond": 6.0}
    test |= {"largest_sigmas": 2.0, "where": "number_density"}
    monkeypatch.setattr(smolux.analysis, "compare", lambda *_: xr.Dataset(attrs=test))
    monkeypatch.setattr(compare, "reference", lambda _: (compare.EXACT, compare.EXACT))
    found = [compare.Computed(name, None, 1.0, 0.0, 1.0) for name in ("one", "two", "three")]
    for count in (1, 2, 3):
        assert compare.rows(found[:count])[2] == (count > 1)


def test_compare_ends_with_1_if_a_method_differs(folder, monkeypatch):
    for agree, code in ((False, 1), (True, 0)):
        monkeypatch.setattr(compare, "rows", lambda found, a=agree: (compare.EXACT, [], a))
        call("compare", "small.toml", "-m", "acceptance-rejection", code=code)


def test_compare_against_the_solver_with_a_figure(folder):
    result = call(
        "compare", "small.toml", "-s", "initial.size=2", "-m", "solver", "-m",
        "acceptance-rejection", "--figure", "c.png",
    )  # fmt: skip
    assert "Compared with solver" in result.stdout
    assert (folder / "c.png").is_file()


def test_demo_agrees_and_can_be_repeated(folder):
    for _ in range(2):
        result = call("demo")
        assert "agrees with the exact solution" in result.stdout
        header = next(line for line in result.stdout.splitlines() if "sigmas" in line)
        assert header.split() == ["time", "clusters", "per", "volume", "95", "%", "exact", "sigmas"]
    names = {p.name for p in (folder / "smolux-demo").iterdir()}
    assert {"results.nc", "clusters.png", "report.html"} <= names


def test_demo_leaves_other_runs_alone(folder):
    call("run", "small.toml", "-o", "mine")
    assert "holds a run of yours" in call("demo", "-o", "mine", code=2).stderr


# --- what goes wrong -------------------------------------------------------------------------


def test_no_memory_is_no_bug_of_ours(folder, monkeypatch):
    def full(*_: object) -> None:
        raise MemoryError("Unable to allocate 7 GiB")

    monkeypatch.setattr(kernels, "overview", full)
    result = call("kernels", code=2)
    assert "out of memory: Unable to allocate 7 GiB" in result.stderr
    assert "bug" not in result.stderr


def test_our_bugs_are_exit_code_1_with_a_file_and_no_traceback(folder, monkeypatch):
    def broken(*_: object) -> None:
        raise ZeroDivisionError("surprise")

    monkeypatch.setattr(kernels, "overview", broken)
    result = call("kernels", code=1)
    assert "internal error: ZeroDivisionError: surprise" in result.stderr
    assert "Traceback" not in result.stderr
    path = result.stderr.split("the file ")[1].split("\n")[0]
    with open(path) as file:
        assert "in broken" in file.read()
    assert "in broken" in call("--debug", "kernels", code=1).stderr


def test_a_folder_that_cannot_be_written_is_no_bug(folder, monkeypatch):
    def denied(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", "small")

    monkeypatch.setattr("pathlib.Path.mkdir", denied)
    assert "Permission denied" in call("run", "small.toml", code=2).stderr


def test_a_full_disk_leaves_the_results_somewhere(folder, monkeypatch):
    save = smolux.results.save

    def full(ds: object, path: object) -> None:
        if "small" in str(path):
            raise OSError(28, f"cannot write {path}: No space left on device")
        save(ds, path)

    monkeypatch.setattr(smolux.results, "save", full)
    stderr = call("run", "small.toml", code=3).stderr
    assert "begin again with: smolux run small" in stderr  # there is no checkpoint
    kept = stderr.split("what was computed is in ")[1].split("\n")[0]
    assert smolux.results.load(kept).attrs["seed"] == "7"
    monkeypatch.undo()
    monkeypatch.chdir(folder)
    call("run", "small")
    assert smolux.results.load(folder / "small" / "results.nc").equals(smolux.results.load(kept))


def test_a_time_limit_stops_and_goes_on(folder):
    call("run", "small.toml", "-o", "whole", "-s", "run.particles=8000000", "-s", "run.replicas=2")
    stopped = call(
        "run", "small.toml", "-o", "cut", "-s", "run.particles=8000000", "-s", "run.replicas=2",
        "-s", "run.time_limit=0.01", code=3,
    )  # fmt: skip
    assert "go on with: smolux run cut" in stopped.stderr
    assert (folder / "cut" / "checkpoint.npz").is_file()
    assert "unfinished" in call("show", "cut").stdout
    text = (folder / "cut" / "case.toml").read_text()
    (folder / "cut" / "case.toml").write_text(text.replace("seed = 7", "seed = 8"))
    assert "was changed" in call("run", "cut", code=2).stderr
    (folder / "cut" / "case.toml").write_text(text.replace("time_limit = 0.01", "time_limit = 600"))
    call("run", "cut")
    assert not (folder / "cut" / "checkpoint.npz").exists()
    whole, cut = (smolux.results.load(folder / n / "results.nc") for n in ("whole", "cut"))
    assert whole.equals(cut)


@pytest.mark.parametrize("kind", [InputError, OutOfMemoryError, WorkerError])
@pytest.mark.parametrize("written", [False, True])
def test_an_error_late_in_a_run_keeps_what_was_computed(folder, monkeypatch, kind, written):
    simulate = smolux.simulate

    def late(*given: object, checkpoint: Path, **settings: object) -> None:
        error = kind("something is wrong")
        error.dataset = simulate(*given, **settings)
        error.dataset.attrs["complete"] = 0
        if written:
            checkpoint.write_bytes(b"as if")
            error.checkpoint = checkpoint
        raise error

    monkeypatch.setattr(smolux, "simulate", late)
    found = call("run", "small.toml", code=2 if kind is InputError else 3).stderr
    assert "error: something is wrong" in found
    assert "what was computed until then is in small" in found
    assert not smolux.results.load(folder / "small" / "results.nc").attrs["complete"]
    # a rate that is no number would be none again
    onward = {InputError: "", OutOfMemoryError: "go on" if written else "begin again"}
    assert f"{onward.get(kind, 'try again')} with: smolux run small" in found or kind is InputError
    assert ("go on" in found) == (written and kind is OutOfMemoryError)


def test_compare_says_that_the_time_limit_was_reached(folder):
    sets = ("-s", "run.particles=8000000", "-s", "run.time_limit=0.01")
    found = call("compare", "small.toml", "-m", "acceptance-rejection", *sets, code=3).stderr
    assert "acceptance-rejection: the time limit of 0.01 s is reached" in found


def test_check_warns_of_breakage_that_makes_many_particles():
    text = SMALL + '[initial]\nname = "monodisperse"\nsize = 1000000\n'
    shattering = '[[processes]]\nname = "shattering"\nrate = 0.1\n'
    case = parse(text + shattering)
    (found,) = cautions._breakage(case, replace(case.run, particles=1000))
    assert "shattering can break the mass up into 1e+09 particles of size 1" in found
    for text_ in (text, SMALL + shattering):  # without breakage, and with monomers
        case = parse(text_)
        assert cautions._breakage(case, case.run) == []

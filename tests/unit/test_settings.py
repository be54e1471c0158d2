"""Arguments declared once: functions, case files and checkpoints read the same table."""

from __future__ import annotations

import inspect
import pickle
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import pytest

import smolux as sx
from smolux import case as cases
from smolux.case import spatial as in_space
from smolux.errors import InputError, Problem, about
from smolux.kernels import KERNELS
from smolux.settings import (
    Control,
    Settings,
    SolverSettings,
    SpatialSettings,
    from_plain,
    plain,
)
from smolux.stochastic.make_plan import make_plan

MODEL = sx.Model(sx.kernels.Constant())
CASE = '[kernel]\nname = "constant"\n'


def names(table: Any) -> set[str]:
    return {f.name for f in fields(table)}


@pytest.mark.parametrize(
    ("call", "tables", "apart"),
    [
        (sx.simulate, [Settings, Control], {"model"}),
        (sx.solve, [SolverSettings], {"model", "progress", "largest", "max_size"}),
        (sx.spatial.simulate, [SpatialSettings], {"system", "method"}),
        (sx.spatial.resume, [SpatialSettings], {"result"}),
    ],
)
def test_a_function_takes_what_is_declared(call: Any, tables: Any, apart: set[str]) -> None:
    arguments = inspect.signature(call).parameters
    declared = {f.name: f.default for table in tables for f in fields(table)}
    assert declared.keys() == arguments.keys() - apart
    for name, default in declared.items():
        given = arguments[name].default
        assert default == given or (default is MISSING and given is inspect.Parameter.empty)


#: what is right and what is wrong, and must be so for a function and for a case file alike
VALUES: dict[str, list[Any]] = {
    "particles": [2, 1, 2**50, 2**51, 2.5],
    "replicas": [1, 0, 2**31 - 1, 2**31],
    "seed": [0, -1, 2**200],
    "method": ["inverse", "inverted"],
    "weighting": ["mass-flow", "number", "mass"],
    "population": ["none", "nothing"],
    "orders": [[0, 2.5], [], [1, 1], [0, 30], ["a"]],
    "sizes": [1, 0, 20_000_000, 10**9],
    "bins_per_octave": [1, 0, 500, 1024, 1025],
    "distribution": [True, "yes", 1],
    "target_error": [0.01, 0.0, 1.0],
    "target": ["M2", "n_5", "M7", "n_2000", "size"],
    "max_replicas": [8, 0],
    "subvolumes": [1, 2, 64, 0, 2000],
    "remix": [0.5, 10, 50, 0],
    "times": [[1, 2], [2, 1], [], [0], [-1, 1]],
    "tolerance": [1e-12, 1e-14, 0.1, 0.2],
    "window": [4, 3, 10**9],
    "max_window": [4, 3, 10**9],
    "gel": ["reacts", "acts"],
    "check": [True, "yes"],
}


#: the same of discs in a box
IN_SPACE: dict[str, list[Any]] = {
    "until": [1.5, 0, float("inf"), "1"],
    "clusters": [3, 0, 0.5],
    "times": [[0, 1], [0], [], [2, 1], [-1, 1]],
    "max_events": [10, 10.5, 0],
    "time_limit": [1.0, 0],
}


@pytest.mark.parametrize("name", IN_SPACE)
def test_a_case_in_space_refuses_what_a_run_refuses(name: str, tmp_path: Path) -> None:
    file = tmp_path / "case.toml"
    for value in IN_SPACE[name]:
        found = refused(SpatialSettings.checked, {name: value})
        written = '"1"' if value == "1" else "inf" if value == float("inf") else repr(value)
        file.write_text(f"[spatial]\ndiscs = 100\n{name} = {written}\n")
        there = refused(in_space.load, file)
        assert len(found) == len(there) <= 1, (value, found, there)
        assert not found or found[0].cure in there[0], (found, there)  # type: ignore[attr-defined]


def refused(call: Any, *args: Any) -> list[str]:
    try:
        call(*args)
    except InputError as error:
        return error.problems
    return []


@pytest.mark.parametrize(
    ("section", "table", "check"),
    [("run", Settings, Settings.for_model), ("solve", SolverSettings, SolverSettings.for_model)],
)
def test_a_case_file_and_a_call_agree_on_what_is_wrong(
    section: str, table: Any, check: Any
) -> None:
    verdicts = set()
    for name in sorted(names(table)):
        for value in VALUES[name]:
            given = {"times": [1.0], "particles": 1000} if section == "run" else {"times": [1.0]}
            given[name] = value
            text = CASE + cases.to_toml({section: given})
            one, other = refused(cases.parse, text), refused(check, MODEL, given)
            assert len(one) == len(other), (name, value, one, other)
            verdicts.add(bool(one))
            for message in one:  # with its line
                assert name in message
                assert "line " in message
            for message in other:
                assert isinstance(message, Problem)
                assert message.path == (name,)
    assert verdicts == {True, False}


def test_what_goes_together_is_looked_at_together() -> None:
    given = {
        "times": [1.0], "subvolumes": 64, "particles": 1000, "target_error": 0.1, "replicas": 3,
        "remix": 50, "weighting": "auto", "target": "largest",
    }  # fmt: skip
    found = refused(Settings.for_model, MODEL, given)
    assert {p.path for p in found} == {  # type: ignore[attr-defined]
        ("remix",), ("target",), ("subvolumes",), ("replicas",),
    }  # fmt: skip
    shown = refused(cases.parse, CASE + cases.to_toml({"run": given}))
    assert [m.partition("line ")[2].partition(":")[0] for m in shown] == ["5", "8", "9", "11"]


def test_settings_are_plain_data_and_back() -> None:
    plan = make_plan(
        MODEL, [0.0, 2.0], method=sx.methods.SizeClass(classes=8), particles=50, seed=2**100,
        weighting=sx.weighting.WeightFunction(0.5), orders=[0, 1.5], target="M1.5", replicas=9,
        target_error=0.2, distribution=True, remix=2, bins_per_octave=3, sizes=7, max_replicas=11,
    )  # fmt: skip
    for settings in (plan.asked, plan):
        again = from_plain(Settings, plain(Settings, settings))
        assert again == {name: getattr(settings, name) for name in names(Settings)}
    assert Settings(**from_plain(Settings, plain(Settings, plan.asked))) == plan.asked
    assert plan.asked.replicas == plan.replicas == 9
    assert plan.rule is not None
    assert (plan.rule.first, plan.rule.most, plan.rule.order) == (9, 11, 1.5)


def test_a_mistake_knows_its_place() -> None:
    one = Problem("rate", "must be positive", -1)
    assert one == "rate = -1: must be positive"
    with pytest.raises(InputError) as caught, about("processes", 2), about("terms"):
        raise InputError([one, "another"])
    first, second = pickle.loads(pickle.dumps(caught.value)).problems
    assert (first, first.path, first.cure) == (one, ("processes", 2, "terms", "rate"), one.cure)
    assert (second, second.path) == ("another", ("processes", 2, "terms"))


#: tables of a model with one mistake, which is in the line that says so
PLACES = """\
[kernel]
name = "formula"
formula = "i*j + c"
c = inf                                 # here
---
[kernel]
formula = "i*j - 2"                     # here
---
[kernel]
formula = "i*x"                         # here
---
[[kernel.terms]]
name = "constant"
[[kernel.terms]]
name = "ballistic"
scale = -1                              # here
---
[[processes]]
name = "aggregation"
[[processes]]
name = "shattering"
rate = "1 - x"                          # here
---
[[processes]]
name = "removal"
rate = 0.1
varying = "sin("                        # here
---
[[processes]]
name = "removal"
above = 1.5                             # here
---
[[processes]]
name = "evaporation"
rate = "1 - k"                          # here
---
[[processes]]
name = "fragmentation"
rate = "-i*j"                           # here
---
[[processes]]
name = "collisional-fragmentation"
rate = 0.1
debris = "-k"                           # here
---
[[processes]]
name = "collisional-fragmentation"
rate = 0.1
debris = 2
largest = 0.5                           # here
---
[[processes]]
name = "source"
rates = { 1 = -1 }                      # here
---
[initial]
name = "exponential"
mean = 0.5                              # here
---
[initial]
name = "lognormal"
median = 20
sigma = 1                               # here
---
[initial]
name = "exponential"
mean = 2
density = -1                            # here
---
[initial]
name = "sizes"
densities = { 1 = 1, 3 = -1 }           # here
---
[spatial]
discs = 100
method = "time-stepping"
times = [1]
step = 9                                # here
"""


@pytest.mark.parametrize("text", PLACES.split("---\n"))
def test_a_mistake_in_the_model_has_its_line(text: str, tmp_path: Any) -> None:
    _told_in_its_line(text, tmp_path)


@pytest.mark.parametrize("law", [k for k in KERNELS if k.name != "formula"])
def test_a_mistake_in_any_parameter_of_a_law_has_its_line(law: Any, tmp_path: Any) -> None:
    for f in fields(law):
        others = [g.name for g in fields(law) if g.default is MISSING and g is not f]
        right = "".join(f"{name} = 0.5\n" for name in others)
        wrong = f'[kernel]\nname = "{law.name}"\n{right}{f.name} = -inf  # here\n'
        _told_in_its_line(wrong, tmp_path)


def _told_in_its_line(text: str, folder: Any) -> None:
    from smolux.case.spatial import load

    line = next(n for n, t in enumerate(text.splitlines(), 1) if t.endswith("# here"))
    if "[spatial]" in text:
        (folder / "case.toml").write_text(text)
        found = refused(load, folder / "case.toml")
    else:
        kernel = "" if "[kernel" in text else "[kernel]\nname = 'constant'\n"
        found = refused(cases.parse, f"{text}{kernel}[run]\ntimes = [1]\n")
    assert len(found) == 1, found
    assert f"line {line}:" in found[0]

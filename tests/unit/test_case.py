from __future__ import annotations

import inspect
import tomllib
from dataclasses import MISSING, fields, replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import smolux as sx
from smolux import initial, kernels, processes
from smolux.case import Case, Output, Run, Solve, load, parse
from smolux.case.spatial import SpatialRun
from smolux.errors import InputError
from smolux.model import Model

GOOD = """\
title = "a test"

[kernel]
name = "generalized-brownian"
a = 0.9

[[processes]]
name = "aggregation"

[[processes]]
name = "shattering"
rate = "0.01 * (1 - t/400)"

[initial]
name = "sizes"
densities = { 1 = 0.5, 3 = 0.25 }

[run]
times = [1, 10.0]
particles = 1e4
seed = 3
"""


def problems(text: str, *sets: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        parse(text, "case.toml", sets)
    return caught.value.problems


# --- reading ---------------------------------------------------------------------------------


def test_a_case_says_what_it_says():
    case = parse(GOOD)
    assert case.model == Model(
        kernels.GeneralizedBrownian(0.9),
        (processes.Aggregation(), processes.Shattering("0.01 * (1 - t/400)")),
        initial.from_sizes({1: 0.5, 3: 0.25}),
    )
    assert case.run == Run((1.0, 10.0), particles=10_000, seed=3)
    assert case.solve is None
    assert case.output == Output()
    assert case.title == "a test"
    assert not case.si


def test_three_mistakes_give_three_messages_with_their_lines():
    text = GOOD.replace("generalized-brownian", "generalised-brownian")
    text = text.replace("particles", "particels").replace('"shattering"', '"shatering"')
    found = problems(text)
    assert found == [
        'case.toml, line 4: kernel.name = "generalised-brownian": is unknown; '
        "did you mean 'generalized-brownian'?",
        'case.toml, line 11: processes[1].name = "shatering": is unknown; '
        "did you mean 'shattering'?",
        "case.toml, line 20: run.particels: no such key; did you mean 'particles'?",
    ]


def test_mistakes_in_values_of_the_model_have_their_lines_too():
    found = problems(GOOD.replace("a = 0.9", "a = 9").replace("0.25 }", "-0.25 }"))
    assert len(found) == 2
    assert found[0].startswith("case.toml, line 5: ")
    assert "a = 9" in found[0]
    assert found[1].startswith("case.toml, line 1")
    assert "-0.25" in found[1]


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("times = [1, 10.0]", "times = [10, 1]", 19, "must ascend, but 1 follows 10"),
        ("times = [1, 10.0]", "times = [1, 1]", 19, "must ascend, but 1 follows 1"),
        ("times = [1, 10.0]", "times = [1, true]", 19, "run.times[1] = true: must be a number"),
        ("times = [1, 10.0]", "times = []", 19, "a list of at least one number"),
        ("times = [1, 10.0]", "times = [nan]", 19, "must be finite"),
        ("times = [1, 10.0]", "", 18, "run.times is missing"),
        ("times = [1, 10.0]", "times = { stop = 3 }", 19, "run.times.count is missing"),
        ("seed = 3", 'weighting = "weight-function"', 18, "run.exponent is missing"),
        ("seed = 3", "exponent = 0.5", 21, 'is for weighting = "weight-function"'),
        ("seed = 3", 'weighting = "weight-function"\nexponent = 9', 22, "from -8 to 8"),
        (
            "times = [1, 10.0]",
            'times = { stop = 3, count = 5, spacing = "log" }',
            19,
            "run.times.start is missing",
        ),
        ("times = [1, 10.0]", "times = { stop = 3, cuont = 5 }", 19, "did you mean 'count'?"),
        ("times = [1, 10.0]", "times = { start = 4, stop = 3, count = 5 }", 19, "after the start"),
        ("particles = 1e4", "particles = 1.5", 20, "a whole number of at least 2"),
        ("particles = 1e4", 'particles = "many"', 20, 'run.particles = "many"'),
        ("particles = 1e4", "orders = [1, 1]", 20, "a list of different finite numbers"),
        ("particles = 1e4", 'method = "fast"', 20, "is unknown"),
        ("particles = 1e4", "distribution = 1", 20, "must be true or false"),
        ("particles = 1e4", 'time_limit = "3 m"', 20, "give a time"),
        (
            "particles = 1e4",
            "time_limit = -1",
            20,
            'a positive number of seconds, or a text such as "2 h"',
        ),
        ("seed = 3", "seed = -3", 21, "must be a whole number"),
        ("seed = 3", "[output]\nfigures = ['momnets']", 22, "did you mean 'moments'?"),
        ("seed = 3", "[solve]\ntimes = [1]", 22, "the times of [run] hold for both"),
        ("seed = 3", "[solve]\ntolerance = 0", 22, "must be a number from 1e-12 to 0.1"),
        ("a = 0.9", 'a = "0.9"', 5, "must be a number"),
        ("a = 0.9", "b = 0.9", 5, "kernel.b: no such key"),
        ('rate = "0.01 * (1 - t/400)"', 'rate = "0.01 * (1 - x/400)"', 12, "unknown name 'x'"),
        ('rate = "0.01 * (1 - t/400)"', "rate = []", 12, "must be a number or a formula in t"),
        ('rate = "0.01 * (1 - t/400)"', "", 10, "processes[1].rate is missing"),
        ("1 = 0.5", "one = 0.5", 16, 'initial size "one"'),
        ("[kernel]", "[kernal]", 3, "did you mean 'kernel'?"),
        ("[[processes]]", "[[proceses]]", 7, "did you mean 'processes'?"),
    ],
)
def test_each_mistake_is_named_with_its_line(old, new, line, words):
    found = problems(GOOD.replace(old, new))
    assert any(f"line {line}:" in p and words in p for p in found), found


def test_syntax_errors_say_where():
    (found,) = problems("[kernel]\nname = constant\n")
    assert "line 2" in found
    assert "quotes" in found


def test_what_is_missing_altogether():
    found = problems("")
    assert len(found) == 2
    assert any("[kernel]" in p for p in found)
    assert any("[run]" in p for p in found)
    assert "two brackets" in " ".join(problems(GOOD.replace("[[processes]]", "[processes]", 1)
                                               .replace("[[processes]]", "[other]")))  # fmt: skip


def test_times_by_a_table():
    text = GOOD.replace("[1, 10.0]", '{ start = 0.1, stop = 100, count = 4, spacing = "log" }')
    assert parse(text).run.times == (0.1, 1.0, 10.0, 100.0)
    text = GOOD.replace("[1, 10.0]", "{ stop = 1, count = 11 }")
    assert parse(text).run.times == tuple(n / 10 for n in range(11))


def defaults(call):
    """Defaults of the arguments of a function, of those that have one."""
    found = inspect.signature(call).parameters.values()
    return {p.name: p.default for p in found if p.default is not p.empty}


@pytest.mark.parametrize(
    ("table", "calls"),
    [
        (Run, [sx.simulate]),
        (Solve, [sx.solve]),
        (SpatialRun, [sx.spatial.lattice, sx.spatial.random, sx.spatial.simulate]),
    ],
)
def test_a_case_file_has_the_defaults_of_a_call(table, calls):
    own = {f.name: f.default for f in fields(table) if f.default is not MISSING}
    for call in calls:
        shared = (own.keys() & defaults(call).keys()) - {"walls"}
        assert len(shared) >= 4
        assert {k: own[k] for k in shared} == {k: defaults(call)[k] for k in shared}


def test_what_decides_on_the_data_arrives():
    apart = {"executor", "progress", "checkpoint", "checkpoint_every", "time_limit"}
    text = GOOD + 'max_replicas = 40\ntarget = "largest"\nweighting = "weight-function"\n'
    given = parse(text + "exponent = 0.5\norders = [0, 4]\nsizes = 9\n[solve]\n")
    arguments = given.run.arguments()
    assert arguments.keys() == (defaults(sx.simulate).keys() - apart) | {"times"}
    assert (arguments["max_replicas"], arguments["target"]) == (40, "largest")
    assert arguments["weighting"] == sx.weighting.WeightFunction(0.5)
    # the solver observes what the simulation does
    solved = given.solve_arguments()
    assert (solved["orders"], solved["sizes"]) == ((0, 4), 9)
    assert solved.keys() <= inspect.signature(sx.solve).parameters.keys()


def test_the_solver_alone_and_beside():
    text = GOOD.partition("[run]")[0]
    case = parse(text + "[solve]\ntimes = [2]\nwindow = 500\n")
    assert case.run is None
    assert case.solve == Solve((2.0,), window=500)
    assert case.times == (2.0,)
    assert parse(GOOD + "[solve]\n").solve == Solve((1.0, 10.0))


# --- units -----------------------------------------------------------------------------------

AEROSOL = """\
[kernel]
name = "brownian"
temperature = "25 degC"
viscosity = "1.8e-5 Pa s"

[initial]
density = "1e6 cm^-3"

[run]
times = ["1 min", "1 h"]
time_limit = 100
"""


def test_units_become_si():
    case = parse(AEROSOL)
    assert case.si
    assert case.model.kernel == kernels.Brownian.continuum(298.15, 1.8e-5)
    assert case.model.initial.total == 1e12
    assert case.run.times == (60.0, 3600.0)
    assert "temperature = 25 degC" in case.to_toml()
    assert parse(case.to_toml()) == case


def test_a_mix_of_units_names_the_keys():
    (found,) = problems(AEROSOL.replace('"1 min"', "60"))
    assert "with a unit: initial.density, kernel.temperature, kernel.viscosity" in found
    assert "without: run.times[0]" in found
    assert "line 10" in found


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"25 degC"', '"25 Pa"', "kernel.temperature = \"25 Pa\": has the unit of something else"),
        ('"25 degC"', "298", "needs its unit: a temperature"),
        ('viscosity = "1.8e-5 Pa s"', "", "kernel.viscosity is missing: give a dynamic viscosity"),
        ('viscosity = "1.8e-5 Pa s"', 'viscosty = "1 Pa s"', "did you mean 'viscosity'?"),
        ('density = "1e6 cm^-3"', "", "initial.density is missing: the case has units"),
        ('temperature = "25 degC"\nviscosity = "1.8e-5 Pa s"', "", "kernel.scale is missing"),
        ('"1 h"', '"1 kg"', "give a time"),
        ('"25 degC"', '"-300 degC"', "temperature"),
    ],
)  # fmt: skip
def test_mistakes_with_units(old, new, words):
    assert any(words in p for p in problems(AEROSOL.replace(old, new)))


def test_parameters_of_a_formula_may_have_units():
    text = '[kernel]\nformula = "c * (i + j)"\nc = "2 cm^3/s"\n'
    case = parse(text + AEROSOL.partition("\n\n")[2])
    assert float(case.model.kernel(1, 2)) == pytest.approx(6e-6)
    assert parse(case.to_toml()) == case


def test_a_formula_may_declare_what_it_knows():
    text = '[kernel]\nformula = "i*j"\ndegree = 2\ngels = true\n[run]\ntimes = [1]\n'
    case = parse(text)
    assert case.model.kernel.degree == 2
    assert case.model.kernel.gels is True
    assert parse(case.to_toml()) == case
    assert "must be true or false" in problems(text.replace("true", '"yes"'))[0]


# --- changes from the command line -----------------------------------------------------------


def test_changes_are_applied_and_checked():
    case = parse(GOOD, "x", ["run.particles=1e5", "processes.shattering.rate=0.5", "title=new"])
    assert case.run.particles == 100_000
    assert case.model.processes[1].rate == 0.5
    assert case.title == "new"
    assert parse(GOOD, "x", ["processes.1.rate=0.5", "solve.window=7"]).solve.window == 7
    assert parse(GOOD, "x", ["run.times=[3]"]).run.times == (3.0,)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("run.particels=1e5", "--set run.particels=1e5: run.particels: no such key; did you mean"),
        ("run.particles=few", '--set run.particles=few: run.particles = "few": must be a whole'),
        ("particles=3", "--set particles=3: particles: no such key"),
        ("run.particles", "must be key=value"),
        ("=3", "must be key=value"),
        ("run=3", "run is a table"),
        ("processes.evaporation.rate=1", "there is no entry 'evaporation'"),
        ("kernel.name=balistic", "did you mean 'ballistic'?"),
        ("run.times.stop=3", "--set run.times.stop=3: "),
    ],
)
def test_mistakes_in_changes_name_the_option(change, words):
    found = problems(GOOD, change)
    assert any(words in p for p in found), found


# --- files -----------------------------------------------------------------------------------


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        load(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is a folder"):
        load(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        load(tmp_path / "binary.toml")


def test_a_seed_is_drawn_once():
    case = parse(GOOD.replace("seed = 3", ""))
    assert case.run.seed is None
    seeded = case.with_seed()
    assert seeded.run.seed is not None
    assert seeded.with_seed() == seeded
    assert parse(seeded.to_toml()) == seeded


# --- properties ------------------------------------------------------------------------------

finite = st.floats(1e-12, 1e12)
times = st.lists(st.floats(1e-9, 1e9), min_size=1, max_size=5, unique=True).map(
    lambda t: tuple(sorted(t))
)
laws = st.one_of(
    st.builds(kernels.Constant, finite),
    st.builds(kernels.Additive, finite),
    st.builds(kernels.Brownian, st.floats(1, 3), finite),
    st.builds(kernels.GeneralizedBrownian, st.floats(-1, 1), finite),
    st.builds(
        lambda a, c: kernels.formula("c*((i/j)**a + (j/i)**a)", a=a, c=c), st.floats(-1, 1), finite
    ),
)
shattering = st.one_of(finite, st.just("0.1*exp(-t)")).map(processes.Shattering)
starts = st.one_of(
    st.builds(initial.monodisperse, finite, st.integers(1, 1000)),
    st.builds(initial.exponential, st.floats(1, 100), finite),
    st.builds(initial.lognormal, finite, st.floats(1.01, 5), finite),
    st.dictionaries(st.integers(1, 2**40), finite, min_size=1, max_size=4).map(initial.from_sizes),
)
runs = st.builds(
    Run,
    times=times,
    particles=st.integers(2, 10**9),
    replicas=st.integers(1, 1000),
    seed=st.one_of(st.none(), st.integers(0, 2**62)),
    method=st.sampled_from(["acceptance-rejection", "inverse"]),
    population=st.sampled_from(["doubling", "fixed-volume"]),
    orders=st.lists(st.integers(0, 5), min_size=1, max_size=4, unique=True).map(tuple),
    sizes=st.integers(1, 10**6),
    distribution=st.booleans(),
    time_limit=st.one_of(st.none(), finite),
)
cases = st.builds(
    Case,
    model=st.builds(
        lambda k, s, i: Model(k, (processes.Aggregation(), *([s] if s else [])), i),
        laws,
        st.one_of(st.none(), shattering),
        starts,
    ),
    run=runs,
    output=st.builds(Output, st.sampled_from([(), ("moments",)]), st.booleans()),
    title=st.text(st.characters(exclude_categories=["Cs"]), max_size=20),
    si=st.booleans(),
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(cases, st.booleans())
def test_a_resolved_case_reads_back_equal(case, solver):
    if solver:
        case = replace(case, solve=Solve(case.times, tolerance=1e-6))
    assert parse(case.to_toml()) == case


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.data(),
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=8),
        st.lists(st.integers(), max_size=3),
        st.dictionaries(st.sampled_from(["name", "stop", "1"]), st.integers(), max_size=2),
    ),
)
def test_any_change_gives_a_case_or_input_error(data, value):
    """Put anything in the place of any value, or take it out, or rename its key."""
    from smolux.case.write import to_toml

    content = tomllib.loads(GOOD)
    holder = content
    key = data.draw(st.sampled_from(sorted(holder)))
    while isinstance(holder[key], (dict, list)) and data.draw(st.booleans()):
        holder = holder[key]
        keys = range(len(holder)) if isinstance(holder, list) else sorted(holder)
        key = data.draw(st.sampled_from(keys))
    if value is None:
        del holder[key]
    elif data.draw(st.booleans()) or isinstance(holder, list):
        holder[key] = value
    else:
        holder[f"{key}x"] = holder.pop(key)
    found = []
    try:
        case = parse(to_toml(content))
    except InputError as error:
        found = error.problems
    else:
        assert parse(case.to_toml()) == case
    assert all(p.startswith("case") for p in found)

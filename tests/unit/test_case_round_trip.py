"""Every case that can be read is written back equal, whichever keys it leaves out."""

from __future__ import annotations

import inspect
import re
from dataclasses import MISSING, fields

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from smolux.case import Output, Parallel, Run, Solve, parse
from smolux.case.physics import FIELDS
from smolux.case.write import to_toml
from smolux.initial import INITIALS
from smolux.kernels import KERNELS
from smolux.processes import PROCESSES
from smolux.settings.solution import OBSERVED
from smolux.units import of_arguments

#: values for every key of a table; a key of a new law, process or setting belongs here
KERNEL = {
    "scale": (1, 0.25), "A": (1,), "B": (0.5,), "mu": (0.4, 1), "dimension": (3, 1.8), "a": (0.9,),
    "temperature": (310,), "pressure": (9e4,), "density": (1800,), "monomer_diameter": (1e-9,),
    "prefactor": (1.3,), "viscosity": (1.8e-5,), "mean_free_path": (7e-8,),
    "exponent": (0.5,), "stability": (100,), "slip_a": (1.257,),
    "slip_b": (0.4,), "slip_c": (1.1,),
}  # fmt: skip
OF_TIME, OF_SIZE, OF_PAIR = (0.5, "0.1*exp(-t)"), (1, "k**(1/3)", [0.1, 0.2]), (0.1, "1/(i*j)")
PROCESS = {
    ("aggregation", "varying"): OF_TIME,
    ("aggregation", "share"): OF_PAIR,
    ("shattering", "rate"): OF_TIME,
    ("shattering", "share"): OF_PAIR,
    ("collisional-fragmentation", "rate"): OF_TIME,
    ("collisional-fragmentation", "debris"): (1.5, "1/k", [1, 0.5]),
    ("collisional-fragmentation", "largest"): (2, 100),
    ("collisional-fragmentation", "share"): OF_PAIR,
    ("evaporation", "rate"): OF_SIZE,
    ("evaporation", "varying"): OF_TIME,
    ("fragmentation", "rate"): OF_PAIR,
    ("fragmentation", "varying"): OF_TIME,
    ("removal", "rate"): OF_SIZE,
    # more digits than a double has
    ("removal", "above"): (100, 2**60 + 1),
    ("removal", "varying"): OF_TIME,
    ("source", "rates"): (2, {"1": 1, "3": 0.25}),
    ("source", "varying"): OF_TIME,
}
LABEL = ("wall",)
INITIAL = {"density": (1, 2.5), "mean": (3,), "median": (5,), "sigma": (1.3,), "size": (1, 7)}
SETTINGS = {
    "particles": (2000,), "replicas": (3,), "seed": (0, 2**70), "method": ("auto",),
    "population": ("fixed-volume",), "orders": ([0, 1.5, 2],), "sizes": (7,),
    "bins_per_octave": (2,),
    "distribution": (True, False), "checkpoint_every": (1, "2 min"), "time_limit": ("1 h", 5),
    "target_error": (), "target": ("M2",), "max_replicas": (20,), "subvolumes": (1, 2),
    "remix": (0.5,), "tolerance": (1e-5,), "window": (100,), "max_window": (200,),
    "gel": ("inert",), "check": (True, False),
    "executor": ("threads",), "workers": (2,), "figures": ([], ["clusters"]), "report": (False,),
    # one goes with the other
    "weighting": ("mass-flow", "auto"), "exponent": (), "address": (),
}  # fmt: skip
UNITS = {
    "scale": "1e-9 cm^3/s", "density": "1e6 cm^-3", "temperature": "25 degC", "pressure": "1 bar",
    "monomer_diameter": "3 nm", "viscosity": "18 uPa s", "mean_free_path": "70 nm",
}  # fmt: skip


def _with_unit(section, name):
    return "1.8 g/cm^3" if (section, name) == ("kernel", "density") else UNITS[name]


def drawn(draw, kind, values, si_section=None):
    """Draw a table of what a dataclass takes: what has no default, and any of the rest."""
    table = {}
    for f in fields(kind):
        given_ = values(f.name)
        needed = f.default is MISSING and f.default_factory is MISSING
        measured = (si_section, f.name) in FIELDS
        if given_ and (needed or measured or draw(st.booleans())):
            table[f.name] = (
                _with_unit(si_section, f.name) if measured else draw(st.sampled_from(given_))
            )
    return table


@st.composite
def tables(draw, kernel, process, initial, si):
    """Draw the tables of a case."""
    section = {"kernel": "kernel", "initial": "initial"} if si else {}
    law = drawn(draw, kernel, KERNEL.__getitem__, section.get("kernel"))
    case = {"kernel": {"name": kernel.name, **law}}
    found = drawn(
        draw, process, lambda key: LABEL if key == "label" else PROCESS[process.name, key]
    )
    if process.name == "removal" and not ({"rate", "above"} & set(found)):
        found["rate"] = 0.1
    case["processes"] = [{"name": "aggregation"}] if draw(st.booleans()) else []
    if process.name != "aggregation" or not case["processes"]:
        case["processes"].append({"name": process.name, **found})
    if initial in ("monodisperse", "sizes"):
        density = UNITS["density"] if si else 2
        case["initial"] = (
            {"name": "sizes", "densities": {"1": density, "3": density}}
            if initial == "sizes"
            else {"name": initial, "density": density}
            | ({"size": 3} if draw(st.booleans()) else {})
        )
    else:
        kind = next(i for i in INITIALS if i.name == initial)
        own = drawn(draw, kind, INITIAL.__getitem__, section.get("initial"))
        case["initial"] = {"name": initial, **own}
    times = {"times": ["1 s", "1 min"] if si else [1, 2]}
    which = draw(st.sampled_from(["run", "solve", "both"]))
    for name, settings_ in (("run", Run), ("solve", Solve)):
        if which in (name, "both"):
            own = drawn(draw, settings_, lambda key: () if key == "times" else SETTINGS[key])
            if name == "solve" and which == "both":
                case[name] = {key: value for key, value in own.items() if key not in OBSERVED}
            else:
                case[name] = times | own
    if "solve" in case and {"window", "max_window"} <= set(case["solve"]):
        del case["solve"]["max_window"]
    for name, settings_ in (("parallel", Parallel), ("output", Output)):
        if draw(st.booleans()):
            case[name] = drawn(draw, settings_, SETTINGS.__getitem__)
    return case


def read_back_equal(content):
    first = parse(to_toml(content))
    again = first.to_toml()
    second = parse(again)
    assert second == first
    assert second.to_toml().splitlines() == [
        line for line in again.splitlines() if not line.startswith("#")
    ]


def test_arguments_of_constructors_say_what_they_measure():
    """Once, where the argument is; the words of the docstring are those of this unit."""
    for kernel in KERNELS:
        for constructor in kernel.constructors:
            make = getattr(kernel, constructor)
            measured = of_arguments(make)
            plain = set(inspect.signature(make).parameters) - set(measured)
            assert plain <= {"dimension", "exponent", "stability", "functionality"}
            for name, dimension in measured.items():
                text = inspect.getdoc(make).partition(f"\n{name} : float")[2].partition(" : ")[0]
                unit = dimension.unit.replace("*", " ").replace("^2", "²").replace("^3", "³")
                assert re.search(rf"\b[Ii]n {re.escape(unit)}\b", text), (name, unit)


LIMITS = settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda k: k.name)
@LIMITS
@given(data=st.data())
def test_every_kernel(kernel, data):
    read_back_equal(
        data.draw(tables(kernel, PROCESSES[0], "monodisperse", data.draw(st.booleans())))
    )


@pytest.mark.parametrize("process", PROCESSES, ids=lambda p: p.name)
@LIMITS
@given(data=st.data())
def test_every_process(process, data):
    si = data.draw(st.booleans())
    read_back_equal(data.draw(tables(KERNELS[0], process, "monodisperse", si)))


@pytest.mark.parametrize("initial", [*(i.name for i in INITIALS), "monodisperse"])
@LIMITS
@given(data=st.data())
def test_every_initial_condition(initial, data):
    source = next(p for p in PROCESSES if p.name == "source")
    read_back_equal(data.draw(tables(KERNELS[0], source, initial, data.draw(st.booleans()))))


@LIMITS
@given(st.booleans(), st.booleans(), st.booleans())
def test_a_formula(gels, parameter, with_initial):
    kernel = {"formula": "c*(i+j)" if parameter else "i+j"}
    kernel |= {"gels": False} if gels else {}
    kernel |= {"c": "2 s"} if parameter else {}
    content = {"kernel": kernel, "run": {"times": [1]}}
    content |= {"initial": {}} if with_initial else {}
    read_back_equal(content)

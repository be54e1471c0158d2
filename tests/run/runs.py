"""Runs that the tests here share: few particles, and parameters that are data, so few loops."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import smolux as sx
from shared import FORMULA, QUICK, VARYING
from smolux.stochastic import checkpoint as checkpoints
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.plan import Plan
from smolux.stochastic.replicas import Group

METHODS = [method.name for method in sx.methods.METHODS]
#: the method, and whether the rate varies: its loop is another one
every_rate = pytest.mark.parametrize(
    ("method", "rate"),
    [
        pytest.param(method, rate, marks=pytest.mark.slow if slow else ())
        for method in METHODS
        for rate, slow in (
            (0.1, method == "fictitious-jumps"),
            (VARYING, method not in QUICK),
        )
    ],
)


def model(rate: Any = 0.1, initial: Any = None, c0: float = 1.0, c1: float = 0.5) -> sx.Model:
    """Make a model whose loop the law tests compile too."""
    kernel = sx.kernels.formula(FORMULA, c0=c0, c1=c1, c2=0.0, c3=0.0)
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(rate)]
    return sx.Model(kernel, processes, initial or sx.initial.from_sizes({1: 0.8, 3: 0.2}))


def plan(model: sx.Model, times: Any, method: str, **settings: Any) -> Plan:
    given = {
        "weighting": "number", "population": "doubling", "particles": 150, "replicas": 3,
        "seed": 5, "orders": (0, 1, 2), "sizes": 40, "bins_per_octave": 2, "distribution": False,
    } | settings  # fmt: skip
    return make_plan(model, times, method=method, **given)


def written(group: Group, path: Path) -> Group:
    """Return what a checkpoint leaves of a group."""
    group.seconds += 1.0
    checkpoints.save(path, group.plan, [group])
    (again,) = checkpoints.load(path, group.plan.model)[1]
    assert isinstance(again, Group)
    assert (again.first, again.seconds) == (group.first, group.seconds)
    again.loop = group.loop
    return again


def _shared(values: Any, **places: Any) -> Any:
    return values.sel({dim: place for dim, place in places.items() if dim in values.dims})


def assert_same(one: Any, other: Any, *without: str) -> None:
    """Compare two datasets bit for bit, where both have times and replicas."""
    times = np.intersect1d(one["time"], other["time"])
    replicas = np.intersect1d(one["replica"], other["replica"])
    assert len(times)
    assert len(replicas)
    assert set(one.data_vars) == set(other.data_vars)
    for name in set(one.data_vars) - set(without):
        a, b = (_shared(ds[name], time=times, replica=replicas) for ds in (one, other))
        if "bin" in a.dims:  # as many as were ever used
            assert not a.isel(bin=slice(b.sizes["bin"], None)).any()
            assert not b.isel(bin=slice(a.sizes["bin"], None)).any()
            both = slice(min(a.sizes["bin"], b.sizes["bin"]))
            a, b = a.isel(bin=both), b.isel(bin=both)
        np.testing.assert_array_equal(a.values, b.values, err_msg=name)

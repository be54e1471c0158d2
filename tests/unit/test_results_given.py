"""What is no result is told so by every function that takes one: in one message, of one kind."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from synthetic import constant_kernel

import smolux as sx
from smolux import analysis, plotting, results
from smolux.errors import InputError
from smolux.results import to_dataset

#: every public function that takes a result, with what else it needs; the last to be called
TAKES: dict[str, Callable[[Any], Any]] = {
    "compare": lambda ds: analysis.compare(ds, "exact"),
    "densities_by_rates": lambda ds: analysis.densities_by_rates(ds, [2]),
    "oscillations": lambda ds: analysis.oscillations(ds),
    "series": lambda ds: analysis.series(ds, "moment"),
    "population": lambda ds: results.population(ds, 0, 1.0),
    "save": lambda ds: results.save(ds, "never-written.nc"),
    "to_csv": lambda ds: results.to_csv(ds, "never-written.csv"),
    "warnings": results.warnings,
    **{
        name: getattr(analysis, name)
        for name in (
            "exact_dataset", "format_sweep", "format_table", "gel_fraction", "gelation",
            "mass_balance", "mean_size", "model_of", "moments", "scaling", "summary",
            "sweep_table", "tables",
        )
    },
}  # fmt: skip
#: to these a Dataset without anything in it, or the tree of a spatial run, is none the worse
OF_ANYTHING = {"model_of", "save", "warnings"}
NO_RESULT: dict[str, Any] = {
    "number": 3,
    "none": None,
    "text": "no such file.nc",
    "path": Path("no such file.nc"),
    "array": np.ones(3),
    "dict": {"time": [1.0]},
    "variable": xr.DataArray([1.0], dims="time"),
}


def test_all_functions_are_here() -> None:
    others = {"SCHEMA", "VARIABLES", "load", "provenance", "require", "to_dataset", "told"}
    assert set(TAKES) == {*analysis.__all__, *results.__all__} - others - {"extrema", "verdict"}


def test_a_verdict_is_of_a_comparison() -> None:
    for given in (3, {}, {"p_value": 1.0}):
        with pytest.raises(InputError, match=r"^found = .*compare returned"):
            analysis.verdict(given)  # type: ignore[arg-type]


@pytest.mark.parametrize("given", NO_RESULT.values(), ids=NO_RESULT)
@pytest.mark.parametrize("name", TAKES)
def test_no_result(name: str, given: Any) -> None:
    with pytest.raises(InputError, match=r"^(ds|first|summary) = ") as error:
        TAKES[name](given)
    assert len(error.value.problems) == 1
    path = isinstance(given, (str, Path))
    assert ("smolux.results.load" in str(error.value)) == path
    assert path or f"of the type {type(given).__name__}; give a result of " in str(error.value)


@pytest.mark.parametrize("given", [xr.Dataset(), xr.Dataset({"a": 1}), xr.DataTree()])
@pytest.mark.parametrize("name", TAKES)
def test_an_empty_result(name: str, given: Any, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    tree = isinstance(given, xr.DataTree)
    if name in OF_ANYTHING and not (tree and name == "model_of"):
        assert not TAKES[name](given) or name == "save"
        return
    with pytest.raises(InputError, match=r"^(ds|first|summary)( = |: )") as error:
        TAKES[name](given)
    assert len(error.value.problems) == 1
    words = ("the type DataTree", "it has no ", "make it with")
    assert any(word in str(error.value) for word in words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("orders", [(0.0,), (0.0, 1.0), (2.0,), ()], ids=str)
def test_moments_that_a_result_lacks(orders: Any, tmp_path: Path, monkeypatch: Any) -> None:
    """What needs others says which, and what does not goes on."""
    monkeypatch.chdir(tmp_path)
    whole = to_dataset(sx.Model(sx.kernels.Constant()), constant_kernel(particles=50, replicas=2))
    ds = whole.sel(order=list(orders))
    for name, need in (("gel_fraction", 1), ("mean_size", 2), ("gelation", 2), ("scaling", 2)):
        if not {1.0, float(need)} <= set(orders):
            with pytest.raises(InputError, match=r"^ds: has moments of the orders .* orders= of"):
                TAKES[name](ds)
        elif name != "gelation":
            TAKES[name](ds)
    with pytest.raises(InputError, match=r"^ds: has moments of the orders"):
        plotting.scaling(ds)
    for name in ("compare", "mass_balance", "moments", "series", "summary", "to_csv"):
        with contextlib.suppress(InputError):  # no KeyError
            TAKES[name](ds)


def test_what_a_result_is_compared_with() -> None:
    ds = to_dataset(sx.Model(sx.kernels.Constant()), constant_kernel(particles=50, replicas=2))
    for given in (3, None, "exactly", Path("no.nc"), xr.Dataset()):
        with pytest.raises(InputError, match=r"^second"):
            analysis.compare(ds, given)  # type: ignore[arg-type]

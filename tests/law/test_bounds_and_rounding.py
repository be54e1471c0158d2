"""Bounds come from NumPy and rates from compiled code: they may differ in the last bits."""

from __future__ import annotations

import json
from typing import Any

import laws
import numpy as np
import pytest

import smolux as sx
from smolux.kernels.formula_kernel import FormulaKernel


class OneUnitLow(FormulaKernel):
    """The constant law of the loop of all laws, its bounds one unit in the last place too low."""

    def bounds(self, a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any]:
        shape = np.broadcast(a, b, c, d).shape
        return np.full(shape, 0.5), np.full(shape, np.nextafter(1.0, 0.0))


@pytest.mark.parametrize("method", [method.name for method in sx.methods.METHODS])
def test_a_bound_one_unit_too_low_is_no_broken_bound(method: str) -> None:
    known = laws.kernel("constant")
    kernel = OneUnitLow(known.expression, known.names, known.values)
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(0.0)]
    ds = sx.simulate(
        sx.Model(kernel, processes), [1.0], method=method, population="fixed-volume",
        particles=50, replicas=400, bins_per_octave=1, seed=5,
    )  # fmt: skip
    assert not any("bound" in text for text in json.loads(ds.attrs["warnings"]))
    exact = sx.exact.finite.number_mean("constant", 50, 1.0)
    laws.agree(ds["particles"].values[:, 0], exact, method)

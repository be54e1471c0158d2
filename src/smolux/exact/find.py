"""Which exact solution a model has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from .additive import Additive
from .base import Solution
from .bilinear import Bilinear
from .constant import Constant
from .multiplicative import Multiplicative
from .shattering import ConstantShattering
from .steady import MultiplicativeShattering

if TYPE_CHECKING:
    from smolux.kernels.base import Kernel
    from smolux.model import Model

#: pairs of sizes at which a kernel must follow the law it claims
_SIZES = np.array([1.0, 2.0, 3.0, 7.0, 50.0, 1000.0, 1e6])


def solution(model: Model, *, gel: Literal["reacts", "inert"] = "reacts") -> Solution | None:
    """Find the exact solution of a model.

    Known are the constant, additive, multiplicative and bilinear kernels with aggregation, the
    constant kernel with shattering at a constant rate, and the steady state of the multiplicative
    kernel with shattering; all for monomers at the start, of any density.

    Parameters
    ----------
    model : Model
    gel : {"reacts", "inert"}
        What a gel does with the finite clusters. It reacts with them in a simulation and in the
        limit of one; in truncated rate equations it does not.

    Returns
    -------
    Solution or None
        None if no exact solution is known.
    """
    model = model.reduced
    rates = _rates(model)
    law = coefficients(model.kernel)
    if rates is None or law is None or model.initial.largest != 1:
        return None
    aggregation, lam = rates
    c, a, b = (aggregation * x for x in law)
    density = float(model.initial.total)
    if lam > 0:
        if c > 0 and a == b == 0 and 1e-8 <= lam <= 1e3:
            return ConstantShattering(density, c, lam)
        if b > 0 and c == a == 0:
            return MultiplicativeShattering(density, b, lam)
        return None
    if a == b == 0:
        return Constant(density, c)
    if c == b == 0:
        return Additive(density, a)
    if c == a == 0:
        return Multiplicative(density, b, gel)
    return Bilinear(density, c, a / c, b / c) if c > 0 else None


def _rates(model: Model) -> tuple[float, float] | None:
    """Return the rate of aggregation and that of shattering relative to it, if constant."""
    rates = {"aggregation": 0.0, "shattering": 0.0}
    for process in model.processes:
        factor = process.factor.constant
        if process.name not in rates or factor is None or process.shared is not None:  # type: ignore[attr-defined]
            return None
        rates[process.name] += factor  # two of a kind are as one with the sum of their rates
    aggregation, shattering = rates["aggregation"], rates["shattering"]
    if not aggregation:
        return None
    return aggregation, shattering / aggregation


def coefficients(kernel: Kernel) -> tuple[float, float, float] | None:
    """Return ``c, a, b`` of a kernel ``c + a (i + j) + b i j`` that declares an exact solution."""
    if kernel.exact is None:
        return None
    k11, k12, k22 = (float(kernel(i, j)) for i, j in ((1, 1), (1, 2), (2, 2)))
    b = k22 - 2 * k12 + k11
    a = k12 - k11 - b
    c = k11 - 2 * a - b
    # differences of equal numbers leave rounding errors
    c, a, b = (x if x > 4e-15 * abs(k22) else 0.0 for x in (c, a, b))
    if np.count_nonzero((c, a, b)) == 1:  # then no difference is needed
        c, a, b = (k11 / ways if x else 0.0 for x, ways in ((c, 1), (a, 2), (b, 1)))
    i, j = _SIZES[:, None], _SIZES
    if not np.allclose(kernel(i, j), c + a * (i + j) + b * i * j, rtol=1e-9, atol=0):
        return None
    return (c, a, b) if max(c, a, b) > 0 else None

"""What tests in several folders share, so that they share compiled loops: parameters are data."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from smolux.kernels.formula_kernel import FormulaKernel
from smolux.methods import METHODS

#: kernel of the tests of laws and of runs: 1, i + j, i j and the ballistic one by its coefficients
FORMULA = "c0 + c1*(i + j) + c2*i*j + c3*(cbrt(i) + cbrt(j))**2*sqrt(1/i + 1/j)"
#: the constant kernel by this formula, in a case file
KERNEL = f"""\
[kernel]
formula = "{FORMULA}"
c0 = 1.0
c1 = 0.0
c2 = 0.0
c3 = 0.0
"""
#: a rate that varies in time, as formulas do it
VARYING = "0.4 * (1 + sin(5 * t))"
#: methods whose loops compile fast; with the others, what does not depend on the method is slow
QUICK = ("size-class", "acceptance-rejection")
#: fictitious jumps are low-rank with one product, and run its loop: of what costs more, the fast
#: tests leave them out
EVERY = [
    pytest.param(name, marks=pytest.mark.slow if name == "fictitious-jumps" else ())
    for name in (method.name for method in METHODS)
]
#: for tests of runs that are stopped on purpose
stopped = pytest.mark.filterwarnings(
    r"default:(the (time )?limit of|memory|no checkpoint|\d+ replicas did not reach)"
    ":smolux.errors.SmoluxWarning"
)
#: for tests of methods where they are slow on purpose
laborious = pytest.mark.filterwarnings("default:.*fewer than 1 in 1000:smolux.errors.SmoluxWarning")
#: for tests of small systems in a fixed volume, which end as one cluster: that is no mistake there
extinction = pytest.mark.filterwarnings(
    "default:.*ended as one cluster:smolux.errors.SmoluxWarning"
)
#: for tests of bounds that are broken on purpose
repaired = pytest.mark.filterwarnings(
    "default:the kernel was found above:smolux.errors.SmoluxWarning"
)


class Low(FormulaKernel):
    """The constant law by the formula of the tests, its bounds an eighth of it."""

    rigorous = False

    def bounds(self, a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any]:
        shape = np.broadcast(a, b, c, d).shape
        return np.zeros(shape), np.full(shape, 0.125)

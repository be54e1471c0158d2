"""Many rates at once, of a function of the user that takes no arrays: by compiled code.

Such a function costs some microseconds for a pair in Python, and a table of the inverse method has
millions of pairs. Few rates are not worth compiling for.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux.functions.content import digest
from smolux.jit.compile import CompileError, entry, user_piece
from smolux.kernels import FunctionKernel, Sum
from smolux.kernels.base import Kernel
from smolux.kernels.varying import Varying
from smolux.weighting.base import Weighting

Float = NDArray[np.float64]

#: pairs from which on compiling is worth its time
MANY = 30_000
#: the most numbers in a table that is kept
_KEPT = 1 << 22


@lru_cache(maxsize=16)
def _over(rate: Callable[..., Any]) -> Any:
    """Compile a rate over two arrays of sizes."""
    value = user_piece(rate)

    def fill(i: Any, j: Any, found: Any, p: Any) -> None:
        for k in range(len(found)):
            found[k] = value(i[k], j[k], *p)

    return entry(fill)


def evaluated(kernel: Kernel) -> Callable[[Any, Any], Float]:
    """Return a frozen kernel on arrays of sizes."""
    if isinstance(kernel, Sum):
        terms = [(number, evaluated(term)) for number, term in kernel.parts]
        return lambda i, j: np.asarray(sum(number * term(i, j) for number, term in terms))
    if isinstance(kernel, Varying):
        return evaluated(kernel.kernel)
    if not isinstance(kernel, FunctionKernel):
        return kernel

    def rates(i: Any, j: Any) -> Float:
        one, two = np.broadcast_arrays(np.asarray(i, float), np.asarray(j, float))
        if one.size < MANY or kernel.takes_arrays:
            return kernel(one, two)
        found = np.empty(one.size)
        try:
            _over(kernel.rate)(one.ravel(), two.ravel(), found, kernel.parameters)
        except CompileError:  # is told where the loop is compiled
            return kernel(one, two)
        return found.reshape(one.shape)

    return rates


class Latest:
    """The table that was made last: every group of replicas asks for the same."""

    def __init__(self) -> None:
        self._held: tuple[Any, Float] | None = None
        self._lock = threading.Lock()

    def forget(self) -> None:
        """Begin anew."""
        self._held = None

    def __call__(
        self, kernel: Kernel, weighting: Weighting, arrays: Callable[..., Float], largest: int
    ) -> Float:
        """Rates of the sizes ``1 .. largest`` with each other."""
        key = type(kernel), digest(kernel.rate), kernel.parameters, weighting, largest
        with self._lock:
            if self._held is not None and self._held[0] == key:
                return self._held[1].copy()
            k = np.arange(1.0, largest + 1)
            table = np.ascontiguousarray(arrays(k[:, None], k[None, :]), float)
            self._held = (key, table.copy()) if table.size <= _KEPT else None
            return table


latest = Latest()

"""What is known of a kernel at very large sizes: whether a gel forms, and how it reacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError
from smolux.kernels.base import Kernel

Float = NDArray[np.float64]

#: sizes between which the growth of a kernel is seen that says nothing of gels itself
_FROM, _TO = 2.0**19, 2.0**20
#: by so much it may grow faster than the size
_STEEP = 1.001
_GEL_SIZES = 1e14, 1e15


def may_gel(kernel: Kernel) -> bool:
    """Whether mass may reach infinite sizes in a finite time.

    As the kernel says; if it does not know, whether ``K(k, k)`` grows faster than k where the
    window would end. A homogeneous kernel of a degree above one gels (F. Leyvraz, Phys. Rep. 383,
    95 (2003), doi:10.1016/S0370-1573(03)00241-2, section 5).
    """
    if kernel.gels is not None:
        return kernel.gels
    low, high = kernel(np.array([_FROM, _TO]), np.array([_FROM, _TO]))
    return bool(low > 0.0 and np.isfinite(high) and high / low > (_TO / _FROM) ** _STEEP)


def gel_affinity(kernel: Kernel, sizes: Float) -> Float:
    """Return ``lim K(k, j) / j`` for large j: the rate at which a mass of gel takes up the size k.

    Zero for kernels that grow more slowly than j, ``(ij)**mu`` with mu < 1: the gel does not react.

    Raises
    ------
    InputError
        If the kernel grows faster than the size of a partner.
    """
    small, large = (kernel(sizes, np.full_like(sizes, j)) / j for j in _GEL_SIZES)
    if not np.all(np.isfinite(large)) or np.any(large > small * (1 + 1e-6)):
        raise InputError(
            f"gel = 'reacts': the {kernel.label} kernel grows faster than the size of a "
            "partner, so the gel would take up everything at once; use gel='inert'"
        )
    return np.where(np.abs(large - small) <= 1e-6 * np.abs(large), large, 0.0)

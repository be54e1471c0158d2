"""Another processor: what a law gives for an array differs from its compiled twin in the last bit.

NumPy and Numba choose their functions by the processor, and on some the power of an array is
another number than the power of its entries. Nothing may rely on either. ``--other-processor``
shows it on every machine: entries of arrays that are rounded, not exact, are moved by one unit in
the last place, up or down by where they stand.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from smolux.functions.formula import Formula
from smolux.functions.user_function import Function
from smolux.kernels import Kernel
from smolux.weighting.base import Weighting

#: what evaluates a law of the user, or one of ours, on arrays
EVALUATIONS = ((Kernel, "__call__"), (Formula, "evaluate"), (Function, "evaluate"))
WEIGHTS = ((Weighting, "weights"), (Weighting, "rate_ratios"))

#: an exact result, as of small whole numbers, is the same everywhere: its last bits are zero
_LAST = np.uint64((1 << 20) - 1)


def moved(values: Any) -> Any:
    """Move the rounded entries of an array by one unit in the last place."""
    values = np.asarray(values)
    if values.dtype != np.float64 or values.size < 2:
        return values
    rounded = np.isfinite(values) & ((np.ascontiguousarray(values).view(np.uint64) & _LAST) != 0)
    up = np.arange(values.size).reshape(values.shape) % 3 > 0
    other = np.nextafter(values, np.where(up, np.inf, -np.inf))
    return np.where(rounded, other, values)


def _elsewhere(evaluate: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(evaluate)
    def call(*args: Any, **named: Any) -> Any:
        return moved(evaluate(*args, **named))

    return call


def change(patch: pytest.MonkeyPatch) -> None:
    """Make the evaluation of laws on arrays that of another processor."""
    for owner, name in (*EVALUATIONS, *WEIGHTS):
        patch.setattr(owner, name, _elsewhere(getattr(owner, name)))

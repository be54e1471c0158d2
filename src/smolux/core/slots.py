"""Slots of nearly equal sizes: ``2**(bits+1)`` sizes one by one, then ``2**bits`` slots an octave.

The slot of a size is its leading ``bits + 1`` binary digits and their place: no table, no search.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from smolux.jit.compile import piece


@intrinsic
def _leading_zeros(typing_context, size):
    """Leading zero bits of an int64 above zero."""
    if not isinstance(size, types.Integer):
        return None

    def emit(context, builder, signature, arguments):
        word, flag = ir.IntType(64), ir.IntType(1)
        kind = ir.FunctionType(word, [word, flag])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.ctlz.i64")
        return builder.call(function, [arguments[0], flag(1)])

    return types.int64(types.int64), emit


@piece
def octave(size):
    """Whole part of the binary logarithm of a size."""
    return np.int64(63) - _leading_zeros(np.int64(size))


@piece
def slot_of(size, bits):
    """Slot of a size; the size itself below ``2**(bits + 1)``."""
    shift = max(octave(size) - bits, np.int64(0))
    return (shift << bits) + (size >> shift)


@piece
def slot_top(slot, bits):
    """Largest size in a slot."""
    shift = max((slot >> bits) - 1, np.int64(0))
    return (((slot - (shift << bits)) + 1) << shift) - 1


@lru_cache(maxsize=32)
def slot_edges(bits: int, octaves: int = 62) -> np.ndarray:
    """Edges of the slots of all sizes below ``2**octaves``; slot 0 is empty.

    Slot ``c`` holds the sizes ``edges[c] .. edges[c + 1] - 1``.
    """
    whole = 1 << bits
    shift = np.repeat(np.arange(1, octaves - bits), whole)
    coarse = (whole + np.tile(np.arange(whole), octaves - bits - 1)) << shift
    return np.concatenate((np.arange(2 * whole), coarse, [1 << octaves])).astype(np.int64)

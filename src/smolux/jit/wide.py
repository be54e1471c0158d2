"""Products of whole numbers of 64 bits, of which both halves serve."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def upper_half(typing_context, word, n):
    """Upper half of the product of two uint64 numbers.

    For 64 random bits and a number `n` it is a whole number uniform in ``0 .. n - 1``, with a bias
    below ``n * 2**-64``; the lower half, ``word * n``, is what is left of the random bits.
    """
    if (word, n) != (types.uint64, types.uint64):
        return None

    def emit(context, builder, signature, arguments):
        double = ir.IntType(128)
        one, two = (builder.zext(argument, double) for argument in arguments)
        product = builder.mul(one, two)
        return builder.trunc(builder.lshr(product, double(64)), ir.IntType(64))

    return types.uint64(types.uint64, types.uint64), emit

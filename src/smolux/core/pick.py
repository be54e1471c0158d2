"""A single particle among those that a store holds together, drawn by the bounds of their rates.

Single particles are counted in slots that are mostly narrower than what a store tells apart. To
draw from such a slot, all that it is stored with would have to be tried. Instead a slot stands for
everything that is stored with it, and a particle of that is taken with a chance in proportion to
the largest rate of its own slot: if rates differ little, at once.
"""

from __future__ import annotations

from smolux.jit.compile import piece

from . import rng
from .slots import slot_of, slot_top
from .state import UNARY_BITS


@piece
def slots_with(c, bits):
    """Which slots of a store, of so many `bits`, hold slot `c`, and which slots these hold.

    Returns
    -------
    first, last : int
        Slots of the store: one that holds more than slot `c`, or all parts of `c`.
    low, high : int
        Slots by which single particles are counted.
    """
    first = slot_of(slot_top(c - 1, UNARY_BITS) + 1, bits)
    last = slot_of(slot_top(c, UNARY_BITS), bits)
    low = slot_of(slot_top(first - 1, bits) + 1, UNARY_BITS)
    return first, last, low, slot_of(slot_top(last, bits), UNARY_BITS)


@piece
def largest_rate(s, r, low, high):
    """Bound of the rate of process `r` for all particles in slots."""
    found = s.most[r, low]
    for c in range(low + 1, high + 1):
        found = max(found, s.most[r, c])
    return found


@piece
def takes(s, r, size, largest):
    """Whether a particle is taken, with a chance of the bound in its slot by the `largest`."""
    bound = s.most[r, slot_of(size, UNARY_BITS)]
    return bound >= largest or rng.uniform(s.rng) * largest < bound

"""When two discs touch, and when a cluster touches a wall."""

from __future__ import annotations

import math

from smolux.jit.compile import piece

#: a cluster that leaves less than this share of an axis free fills the box along it
FILLED = 1e-12
#: a period of less than two largest diameters and twice this share of one is narrow: two images of
#: a disc may be near another one, and both are looked at
NARROW = 0.25


@piece
def larger(a, b):
    """Return the larger of two numbers; the builtin takes much longer to compile."""
    return a if a > b else b


@piece
def smaller(a, b):
    """Return the smaller of two numbers."""
    return a if a < b else b


@piece
def largest(values):
    """Return the largest of some numbers that are not negative."""
    found = 0.0
    for value in values:
        found = larger(found, value)
    return found


@piece
def power(x, axes):
    """Return the product of as many factors `x` as there are axes."""
    product = x
    for _ in range(len(axes) - 1):
        product *= x
    return product


@piece
def apart(s):
    """Begin the sums that `contact_time` needs, for two discs whose radii add up to `s`.

    With the separation d and the relative velocity w: ``|w|^2``, ``d.w``, ``|d|^2 - s^2``,
    ``|d x w|^2``; then the components of d and w along the two axes before, for the last of these.
    """
    return 0.0, 0.0, -s * s, 0.0, 0.0, 0.0, 0.0, 0.0


@piece
def add_axis(sums, x, w):
    """Add the components of d and w along one more axis."""
    a, b, c, cross, x1, w1, x2, w2 = sums
    one, two = x * w1 - x1 * w, x * w2 - x2 * w
    return a + w * w, b + x * w, c + x * x, cross + (one * one + two * two), x, w, x1, w1


@piece
def contact_time(sums, s):
    """Time to the contact of two discs; infinite if they miss each other.

    With the sums a, b, c and cross of `add_axis`: the root of ``a t^2 + 2 b t + c`` is taken in the
    form without cancellation, and so is ``b^2 - a c``, which from afar would lose the radii. Discs
    that touch and approach meet now; those that part never do.
    """
    a, b, c, cross = sums[:4]
    if b >= 0.0:
        return math.inf
    if c <= 0.0:
        return 0.0
    square = a * s * s - cross
    return c / (math.sqrt(square) - b) if square >= 0.0 else math.inf


@piece
def wall_time(low, high, v, length):
    """Time until what reaches from `low` to `high` touches a wall of an axis, if it moves there."""
    if v > 0.0:
        return larger(length - high, 0.0) / v
    if v < 0.0:
        return larger(low, 0.0) / -v
    return math.inf


@piece
def shift(d, period):
    """Return what makes a component of a separation that of the nearest image."""
    return -period * math.floor(d / period + 0.5) if period > 0.0 else 0.0


@piece
def other_image(d, period):
    """Return what makes a component, that of the nearest image, that of the next but one."""
    return -period if d > 0.0 else period

"""Rows that travel with particles: how many of the monomers of each are of which kind.

Of C kinds a row has the first C - 1; the rest of the size is of the last kind. The work arrays of a
method that carries rows have, beside its own,

- ``row``: of the particle that is being put in;
- ``mixed``: what those had that were taken out, and no other has yet;
- ``account``: what came in and what left, of each kind, and of all in the last column;
- ``born``: for each process what of `POOL` monomers that it brings in is of which kind.
"""

from __future__ import annotations

import numpy as np

from smolux.jit.compile import entry, piece

from .hypergeometric import hypergeometric
from .record import find_bin
from .state import PROCESS

#: as many monomers as sources are taken to draw from: drawing with and without return is the same
POOL = 1 << 50
CAME, LEFT = 0, 1


@piece
def empty(w):
    """Begin with nothing."""
    for d in range(w.mixed.shape[0]):
        w.mixed[d] = 0


@piece
def fill_from_source(s, w, size):
    """Draw what a particle has that comes in."""
    born = w.born[s.count[PROCESS]]
    rest, left = np.int64(POOL), size
    for d in range(w.mixed.shape[0]):
        w.mixed[d] = hypergeometric(s.rng, rest, born[d], left)
        w.account[CAME, d] += w.mixed[d]
        rest -= born[d]
        left -= w.mixed[d]
    w.account[CAME, w.mixed.shape[0]] += size


@piece
def share_out(s, w, size, total):
    """Write a fair share of what is mixed, `total` monomers, into the row."""
    if size == total:
        for d in range(w.mixed.shape[0]):
            w.row[d], w.mixed[d] = w.mixed[d], 0
        return
    rest, left = total, size
    for d in range(w.mixed.shape[0]):
        found = hypergeometric(s.rng, rest, w.mixed[d], left)
        rest -= w.mixed[d]
        left -= found
        w.row[d] = found
        w.mixed[d] -= found


@piece
def leave(w, total):
    """Count what is left as gone."""
    for d in range(w.mixed.shape[0]):
        w.account[LEFT, d] += w.mixed[d]
    w.account[LEFT, w.mixed.shape[0]] += total


def _deal(words, sizes, rows, pool, total):
    for k in range(sizes.shape[0]):
        rest, left = total, sizes[k]
        for d in range(pool.shape[0]):
            found = hypergeometric(words, rest, pool[d], left)
            rest -= pool[d]
            left -= found
            rows[k, d] = found
            pool[d] -= found
        total -= sizes[k]


#: ``deal(words, sizes, rows, pool, total)``: give each of some particles its share of a pool
deal = entry(_deal)


def _observe(sizes, rows, grid, most, out):
    kinds, total = out.shape[1], out.shape[0] - 2
    for k in range(sizes.shape[0]):
        size = sizes[k]
        rest = size
        place = size - 1 if size <= most else most + find_bin(grid, size)
        unit = 1.0 if size <= most else 1.0 / size
        for c in range(kinds):
            x = rows[k, c] if c < kinds - 1 else rest
            rest -= x
            value = x * unit
            out[place, c, 0] += value
            out[place, c, 1] += value * value
            out[total, c, 0] += x
            out[total, c, 1] += float(x) * x / size


#: ``observe(sizes, rows, grid, most, out)``: add sums over particles, see
#: `smolux.stochastic.carrying.observe_rows`
observe = entry(_observe)

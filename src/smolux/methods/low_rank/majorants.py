"""Majorants as tables over slots of sizes: of powers, or found from bounds of the kernel."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from smolux.kernels.majorant import Majorant
from smolux.methods.base import Float, Int, Rates

#: the tables are this much above what they are computed to be: rounding differs between programs
_ROUNDING = 1e-12
#: factors of a majorant that is found: what `fitted` combines
_FACTORS, _TERMS = 7, 4
#: pairs of slots on which the weights of the terms are sought
_PAIRS = 4000
#: a term of less than this share in every pair is left out
_SMALL_SHARE = 1e-9
_SWEEPS = 4
#: bounds below this share of the largest are raised to it: bounds of a rate of zero may be no more
#: than rounding, of which nothing can be made a multiple
_LEAST = 1e-150
#: units are between 4 to this power and its inverse, which are far from the ends of all numbers
_MOST_HALVINGS = 500


class Tables(NamedTuple):
    """The majorant over slots for S stages; see `smolux.methods.low_rank.store.Work`."""

    factor: Float
    shares: Float
    weights: Float
    term: Int
    rank: Int
    units: Float

    @classmethod
    def empty(cls, stages: int, slots: int) -> Tables:
        """Make tables in which nothing is known yet."""
        return cls(
            np.zeros((stages, slots, _FACTORS)),
            np.zeros((stages, slots)),
            np.zeros((stages, _TERMS)),
            np.zeros((stages, _TERMS, 2), np.int64),
            np.zeros((stages, 3), np.int64),
            np.ones(stages),
        )


class Found(NamedTuple):
    """``A = sum_k weight_k factor[left_k] factor[right_k]`` over the slots from 1 on."""

    factor: Float
    weight: Float
    term: Int

    def __call__(self) -> Float:
        """Evaluate ``A + A^T`` for all pairs of slots."""
        left, right = self.factor[self.term[:, 0]], self.factor[self.term[:, 1]]
        half = np.einsum("k,ki,kj->ij", self.weight, left, right)
        return np.asarray(half + half.T)

    def store(self, tables: Tables, stage: int, units: float) -> None:
        """Write into a row of the tables, as a majorant of rates times `units`."""
        factors, slots = self.factor.shape
        terms = len(self.weight)
        tables.factor[stage, 1 : slots + 1, :factors] = self.factor.T * (1.0 + _ROUNDING)
        tables.weights[stage, :terms] = self.weight
        tables.term[stage, :terms] = self.term
        tables.rank[stage] = factors, terms, 0
        tables.units[stage] = units


def units_of(rates: Float) -> float:
    """Return units in a rate of one, the largest of some rates being about one unit.

    An even power of two: nothing that is computed of them is rounded otherwise for it, square
    roots included.
    """
    largest = float(np.max(np.abs(rates), initial=0.0))
    half = math.frexp(largest)[1] // 2 if largest < math.inf else 0
    return math.ldexp(1.0, -2 * min(max(half, -_MOST_HALVINGS), _MOST_HALVINGS))


def from_powers(majorant: Majorant, edges: Int) -> Tables:
    """Tabulate a majorant that holds for all sizes: one stage.

    Each power is taken at the end of a slot where it is larger; in a term of negative weight, where
    it is smaller.
    """
    powers = [(weight < 0, exponent) for weight, *pair in majorant.terms for exponent in pair]
    rows = sorted(dict.fromkeys(powers))  # those that bound from below are the last
    below = sum(lower for lower, _ in rows)
    low, high = edges[1:-1].astype(float), (edges[2:] - 1).astype(float)
    ends = np.sort([(low**e, high**e) for _, e in rows], axis=1)
    least, most = ends[:, 0] * (1.0 - _ROUNDING), ends[:, 1] * (1.0 + _ROUNDING)
    lower = np.array([lower for lower, _ in rows])
    factor = np.where(lower[:, None], least, most)
    # every factor falls by at most this share from its bound
    share = np.sqrt(majorant.least) * (least / most).min(axis=0) * (below == 0)
    term = [[rows.index(p) for p in powers[2 * k : 2 * k + 2]] for k in range(len(majorant.terms))]
    weights = np.array([weight for weight, _, _ in majorant.terms])
    units = units_of(weights)
    return Tables(
        np.concatenate((np.zeros((1, len(rows))), factor.T))[None].copy(),
        np.concatenate(([0.0], share))[None],
        (weights * units)[None],
        np.array([term], np.int64),
        np.array([[len(rows), len(term), below]], np.int64),
        np.array([units]),
    )


def fill_bounds(bound: Float, rates: Rates, edges: Int, stage: int) -> int:
    """Bound the rate for all pairs of slots below ``2**(stage + 1)``; return how many slots.

    An octave at a time, always the same: a bound must not depend on which replica asked first.
    """
    ends = np.searchsorted(edges, np.int64(2) ** np.arange(stage + 2))
    for first, last in pairwise(ends):
        if not np.isnan(bound[1, last - 1]):
            continue
        a, b = _sides(edges, np.arange(1, last)[:, None])
        c, d = _sides(edges, np.arange(first, last)[None, :])
        upper = _rate_bounds(rates, a, b, c, d)
        bound[1:last, first:last] = upper
        bound[first:last, 1:last] = upper.T
        corner = upper[first - 1 :]
        bound[first:last, first:last] = np.maximum(corner, corner.T)
    return int(ends[-1])


def _sides(edges: Int, slots: Any) -> tuple[Float, Float]:
    return edges[slots].astype(float), (edges[slots + 1] - 1).astype(float)


def _rate_bounds(rates: Rates, a: Float, b: Float, c: Float, d: Float) -> Float:
    upper = np.array(rates.bounds(*np.broadcast_arrays(a, b, c, d))[1], float)
    if not rates.rigorous:
        # zeros alone prove nothing: candidates must go on coming
        sampled = upper[np.isfinite(upper)].max(initial=0.0)
        upper = np.where(upper > 0.0, upper, sampled)
    upper[np.isinf(upper)] = np.nan
    return np.maximum(upper, 0.0)


def fitted(upper: Float, single: bool) -> Found:
    """Find a majorant of few terms that is nowhere below `upper`, and not far above.

    The terms are made of the law itself: its values with the smallest and with the largest size,
    on the diagonal, their geometric means, and the largest rate of a size with any smaller one,
    which alone is a majorant: ``K(i, j) <= H(max(i, j)) <= H(i) + H(j)``. Their weights are those
    of the least mean excess over all pairs; then each size is scaled down as far as possible.

    Parameters
    ----------
    upper : ndarray of shape (slots, slots)
        Symmetric.
    single : bool
        Whether only one product of equal factors is wanted.
    """
    one = np.ones((1, len(upper)))
    upper = np.where(upper > 0.0, np.maximum(upper, _LEAST * upper.max()), 0.0)
    if single or not upper.any():
        return _scaled(Found(one, np.array([0.5]), np.zeros((1, 2), np.int64)), upper)
    diagonal = np.sqrt(np.diag(upper))
    first, last = upper[0], upper[-1]
    highest = np.maximum.accumulate(np.triu(upper).max(axis=0))
    rows = np.array(
        [
            first,
            last,
            diagonal,
            np.sqrt(first * diagonal),
            np.sqrt(last * diagonal),
            highest,
            one[0],
        ]
    )
    rows /= np.maximum(rows.max(axis=1, keepdims=True), 1e-300)
    found = Found(rows, np.ones(4), np.array([[0, 1], [2, 2], [3, 4], [5, 6]]))
    return _scaled(_reduced(found._replace(weight=_weights(found, upper))), upper)


def _weights(found: Found, upper: Float) -> Float:
    """Find weights for which it holds on a sample of pairs, with the least mean excess."""
    from scipy.optimize import linprog

    i, j = np.triu_indices(len(upper))
    kept = np.flatnonzero(upper[i, j] > 0.0)
    kept = kept[np.linspace(0, len(kept) - 1, min(len(kept), _PAIRS)).astype(int)]
    i, j = i[kept], j[kept]
    left, right = found.factor[found.term[:, 0]], found.factor[found.term[:, 1]]
    ratio = (left[:, i] * right[:, j] + left[:, j] * right[:, i]) / upper[i, j]
    scale = np.maximum(ratio.mean(axis=1, keepdims=True), 1e-300)
    solved = linprog(np.ones(len(ratio)), -(ratio / scale).T, -np.ones(len(i)))
    alone = np.array([0.0, 0.0, 0.0, 1.0])
    weight = solved.x if solved.status == 0 else alone
    return np.asarray(np.maximum(weight, 0.0) / scale[:, 0])


def _reduced(found: Found) -> Found:
    """Leave out terms without weight, and factors that no term needs."""
    kept = found.weight > _SMALL_SHARE * found.weight.max()
    used, term = np.unique(found.term[kept], return_inverse=True)
    return Found(found.factor[used], found.weight[kept], term.reshape(-1, 2))


def _scaled(found: Found, upper: Float) -> Found:
    """Multiply the majorant by ``d_i d_j``, the least for which it holds.

    Each ``d_i`` in turn is lowered to what the others need; the small sizes, of which there are
    most particles, come first.
    """
    with np.errstate(all="ignore"):
        ratio = np.where(upper > 0.0, upper / found(), 0.0)
    d = np.full(len(upper), np.sqrt(ratio.max(initial=0.0)))
    for _ in range(_SWEEPS):
        for k in range(len(d)):
            row = ratio[k]
            with np.errstate(all="ignore"):
                others = np.where(row > 0.0, row / d, 0.0)
            others[k] = np.sqrt(row[k])
            d[k] = others.max()
    return found._replace(factor=found.factor * d)

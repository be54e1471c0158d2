"""Majorants of low rank: above the law everywhere, and not far."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import smolux as sx
from smolux.core.slots import slot_edges
from smolux.kernels import KERNELS, Kernel, Majorant
from smolux.methods.low_rank.majorants import fill_bounds, fitted, from_powers
from smolux.stochastic.rates import rates_for
from smolux.weighting import Number

#: no scale is one, which hides what lacks it
LAWS = [
    *(law(**law.example, scale=2.5) for law in KERNELS if "scale" in law.__dataclass_fields__),
    sx.kernels.Bilinear(0.0, 0.3, scale=0.3),
    sx.kernels.Product(-1.5, scale=3.0),
    sx.kernels.Brownian(1.8, scale=1e-16),
    sx.kernels.Clusters(2.1, 0.3, 40.0, scale=0.3),
    sx.kernels.GeneralizedBrownian(-0.4, scale=3.0),
]
every_law = pytest.mark.parametrize("law", LAWS, ids=repr)

#: mean of K over the majorant that is found, for pairs spread evenly in the logarithms of the sizes
FOUND = {
    "i + j": 0.85,
    "i*j": 0.85,
    "1 + 0.3*(i + j) + 0.2*i*j": 0.6,
    "(i/j)**0.9 + (j/i)**0.9": 0.7,
    "(cbrt(i) + cbrt(j))**2 * sqrt(1/i + 1/j)": 0.65,
    "abs(i - j)": 0.4,
    "exp(-(log(i/j))**2)": 0.05,
}


def pairs(largest: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    i, j = np.floor(largest ** rng.random((2, 20_000)))
    j[:5000] = i[:5000]  # the diagonal
    j[5000:10_000] = np.minimum(np.floor(i[5000:10_000] * 2 ** rng.random(5000)), largest)
    return np.append(i, [1.0, 1.0, largest]), np.append(j, [1.0, largest, largest])


@every_law
def test_the_majorant_holds_for_all_sizes_and_touches(law: Kernel) -> None:
    majorant = law.majorant()
    assert majorant is not None
    ratio = law(*pairs(1e12)) / majorant(*pairs(1e12))
    assert ratio.max() <= 1.0 + 1e-12
    assert ratio.min() >= majorant.least - 1e-12
    # neither the bound nor the least share is stated worse than it is
    assert ratio.max() > 0.999
    assert ratio.min() < majorant.least + 1e-3


@every_law
def test_known_shares(law: Kernel) -> None:
    majorant = law.majorant()
    assert majorant is not None
    expected = {"ballistic": np.sqrt(0.5), "sedimentation": 0.0}.get(law.name, 1.0)
    assert majorant.least == pytest.approx(expected)


@pytest.mark.parametrize("bits", [0, 3, 6])
@every_law
def test_tables_over_slots(law: Kernel, bits: int) -> None:
    majorant = law.majorant()
    assert majorant is not None
    edges = slot_edges(bits)
    tables = from_powers(majorant, edges)
    i, j = pairs(1e12)
    a, b = (np.searchsorted(edges, x, side="right") - 1 for x in (i, j))
    factor, share = tables.factor[0], tables.shares[0]
    above = sum(
        w * (factor[a, p] * factor[b, q] + factor[b, p] * factor[a, q])
        for w, (p, q) in zip(tables.weights[0] / tables.units[0], tables.term[0], strict=True)
    )
    value = law(i, j)
    assert (value <= above).all()
    assert (value >= share[a] * share[b] * above).all()
    if majorant.least > 0.0:
        # a factor changes by at most its exponent times the width of a slot
        largest = max(map(abs, majorant.exponents))
        least = majorant.least * (1.0 + 2.0**-bits) ** (-2 * largest) * (1 - 1e-9)
        assert (value / above).min() >= least


@pytest.mark.parametrize("text", FOUND)
def test_a_majorant_is_found_for_any_law(text: str) -> None:
    law = sx.kernels.formula(text)
    rates = rates_for(sx.Model(law), Number())
    assert rates.majorant is None
    edges, stage = slot_edges(3), 15
    bound = np.full((len(edges) - 1, len(edges) - 1), np.nan)
    slots = fill_bounds(bound, rates, edges, stage)
    assert edges[slots] == 2 ** (stage + 1)
    i, j = pairs(2.0**16 - 1)
    a, b = (np.searchsorted(edges, x, side="right") - 2 for x in (i, j))
    value = law(i, j)
    upper = bound[1:slots, 1:slots]
    np.testing.assert_array_equal(upper, upper.T)
    excess = []
    for single in (False, True):
        found = fitted(upper, single)()
        assert (found >= upper * (1 - 1e-12)).all()
        assert (value <= found[a, b] * (1 + 1e-12)).all()
        used = found[a, b] > 0.0
        excess.append(float((value[used] / found[a, b][used]).mean()))
    assert excess[0] > FOUND[text]
    # one product is a special case of several
    assert excess[0] > 0.9 * excess[1]


def test_bounds_do_not_depend_on_what_is_asked_for_first() -> None:
    rates = rates_for(sx.Model(sx.kernels.formula("(i + j)**0.3 + abs(i - j)")), Number())
    edges = slot_edges(2)
    at_once, by_and_by = np.full((2, len(edges) - 1, len(edges) - 1), np.nan)
    fill_bounds(at_once, rates, edges, 9)
    for stage in range(10):
        fill_bounds(by_and_by, rates, edges, stage)
    np.testing.assert_array_equal(at_once, by_and_by)


def test_one_product_of_a_product_is_the_law_itself() -> None:
    sizes = np.arange(1.0, 60.0)
    upper = np.outer(sizes, sizes)
    np.testing.assert_allclose(fitted(upper, True)(), upper, rtol=1e-12)


def test_laws_with_zeros() -> None:
    # only unequal parities react
    sizes = np.arange(1.0, 40.0)
    upper = np.where((sizes[:, None] + sizes) % 2 == 1, 1.0, 0.0)
    for single in (False, True):
        found = fitted(upper, single)()
        assert (found >= upper * (1 - 1e-12)).all()
        assert found.max() < 3.0
        assert not fitted(np.zeros((5, 5)), single)().any()


def test_exponents_are_counted_once() -> None:
    majorant = Majorant(((1.0, 1.0, 0.0), (2.0, 0.0, 1.0), (3.0, 2.0, 1.0)))
    assert majorant.exponents == (1.0, 0.0, 2.0)
    for i, j in product((1.0, 3.0), (1.0, 5.0)):
        assert majorant(i, j) == 3 * (i + j) + 3 * i * j * (i + j)

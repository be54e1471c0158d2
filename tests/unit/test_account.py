"""Number and mass must close, or there is no result; sizes on a lattice; gels of formulas."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

import smolux as sx
from smolux.deterministic import SolverError
from smolux.deterministic import terms as terms_module
from smolux.deterministic.account import Account, Entry
from smolux.deterministic.gel import may_gel
from smolux.deterministic.lattice import on_multiples
from smolux.deterministic.low_rank import LowRank
from smolux.deterministic.solver import with_error
from smolux.errors import InputError, SmoluxWarning
from smolux.settings import SolverSettings

P = sx.processes
AGGREGATION = P.Aggregation()
K1 = sx.kernels.Constant()


def test_entries_add_up_to_what_is_missing():
    account = Account(1e-8, 2.0, 5.0)
    nothing = Entry(5.0, 5.0, 0.0, 0.0, 0.0)
    account.add(Entry(2.0, 1.5, -0.5, -0.5, -0.5), nothing)
    assert account.problem is None
    account.add(Entry(1.5, 1.25 + 1e-7, -0.25, -0.25, -0.25), nothing)
    assert account.number == pytest.approx(5e-8)
    assert account.problem is None
    account.add(Entry(1.25, 1.0 + 4e-7, -0.25, -0.25, -0.25), nothing)
    assert "number of particles" in account.problem
    less = Account(1e-8, 2.0, 5.0)
    less.add(Entry(2.0, 2.0, 0.0, 0.0, 0.0), Entry(5.0, 4.0 + 1e-6, -1.0, -1.0, -1.0))
    assert less.mass == pytest.approx(2e-7)
    assert "the mass differs" in less.problem
    assert account.closes(nothing)
    assert not account.closes(nothing, Entry(1.0, 1.0, 0.0, 1e-7, 0.0))


@pytest.mark.parametrize("share", [1e-3, -1e-3, 1e-6])
def test_sums_that_lose_pairs_give_no_result(monkeypatch, share):
    whole = LowRank._all
    monkeypatch.setattr(LowRank, "_all", lambda self, n: (1.0 - share) * whole(self, n))
    model = sx.Model(K1, [AGGREGATION, P.Shattering(0.1)])
    with pytest.raises(SolverError, match="do not add up") as caught:
        sx.solve(model, [0.0, 5.0], method="low-rank")
    ds = caught.value.dataset
    assert ds.attrs["complete"] == 0
    assert float(ds["number_density"][0, 0]) == 1.0
    # the sum over all pairs has nothing of it
    ds = sx.solve(model, [5.0])
    assert ds.attrs["operator"] == "direct"
    found = sx.solve(model, [5.0], method="direct")
    np.testing.assert_allclose(ds["moment"], found["moment"], rtol=1e-7)


def test_a_term_that_makes_too_much_gives_no_result(monkeypatch):
    class Careless(terms_module.Leaving):
        def add(self, p, factor, n, meeting, flow):
            super().add(p, factor, n, meeting, flow)
            flow.rates += 1e-4 * factor[:, None] * self.vanishing * n

    monkeypatch.setattr(terms_module, "Leaving", Careless)
    with pytest.raises(SolverError, match="do not add up"):
        sx.solve(sx.Model(K1, [AGGREGATION, P.Removal("0.2*k")]), [1.0], method="direct")


@pytest.mark.parametrize(
    "processes",
    [
        [P.Shattering(0.3)],
        [P.CollisionalFragmentation(0.3, [3, 2, 1])],
        [P.Fragmentation("0.3/(i*j)")],
        [P.Evaporation("0.2*k")],
        [P.Removal("0.1*sqrt(k)"), P.Source({2: 0.5, 9: 0.1})],
        [P.Removal(above=11)],
    ],
)
@pytest.mark.parametrize("method", ["direct", "low-rank"])
def test_number_and_mass_close(processes, method):
    start = sx.initial.from_sizes({3: 1.5, 7: 1.0})
    ds = sx.solve(sx.Model(sx.kernels.Brownian(), [AGGREGATION, *processes], start), [0.3, 1.0],
                  method=method)  # fmt: skip
    assert abs(ds.attrs["number_defect"]) < 1e-7
    assert abs(ds.attrs["mass_defect"]) < 1e-7
    # an account is of use only where its terms are found in another way
    assert ds.attrs["terms_defect"] < 1e-10


@pytest.mark.parametrize("method", ["direct", "low-rank"])
def test_sizes_with_a_common_divisor_cost_what_monomers_cost(method):
    kernel = sx.kernels.Brownian()
    ds = sx.solve(
        sx.Model(kernel, [AGGREGATION, P.Removal("0.1*k/30")], sx.initial.monodisperse(size=30)),
        [0.0, 3.0], sizes=200, method=method,
    )  # fmt: skip
    assert ds.attrs["unit"] == 30
    one = sx.solve(sx.Model(kernel, [AGGREGATION, P.Removal("0.1*k")]), [0.0, 3.0], method=method)
    np.testing.assert_allclose(ds["number_density"], one["number_density"], rtol=1e-7)
    n = ds["n"].values[0].copy()
    np.testing.assert_allclose(n[:, 29::30], one["n"].values[0][:, :6], rtol=1e-6)
    n[:, 29::30] = 0.0
    assert not n.any()
    np.testing.assert_allclose(
        ds["n"].sum("size") + ds["n_bin"].sum("bin"), ds["number_density"], rtol=1e-12
    )


def test_what_makes_other_sizes_has_no_common_divisor():
    start = sx.initial.monodisperse(size=30)
    for process in (P.Shattering(0.1), P.Evaporation(0.1), P.Source({45: 1.0})):
        ds = sx.solve(sx.Model(K1, [AGGREGATION, process], start), [0.1])
        assert ds.attrs["unit"] == (15 if isinstance(process, P.Source) else 1)
    # a window is that of the sizes, not of their numbers
    with pytest.warns(SmoluxWarning, match="leave out window"):
        ds = sx.solve(sx.Model(K1, [AGGREGATION], start), [10.0], window=120)
    assert json.loads(ds.attrs["window"]) == [120]


@pytest.mark.parametrize("law", [sx.kernels.Brownian(), sx.kernels.Additive(0.3)], ids=str)
def test_kernel_on_multiples(law):
    kernel = on_multiples(law, 7)
    i = np.array([1.0, 2.0, 5.0])
    np.testing.assert_array_equal(kernel(i, 3.0), law(7 * i, 21.0))
    left, right = kernel.low_rank_factors(i)
    np.testing.assert_allclose((left.T @ right), kernel(i[:, None], i[None, :]), rtol=1e-13)


@pytest.mark.parametrize(
    ("text", "gels"),
    [
        ("i*j", True),
        ("i + j", False),
        ("(i*j)**0.6", True),
        ("i*j/(1 + i*j/1e6)", False),
        ("2", False),
    ],
)
def test_kernels_that_do_not_say_whether_they_gel(text, gels):
    assert may_gel(sx.kernels.formula(text)) is gels
    assert may_gel(sx.kernels.formula(text, gels=not gels)) is not gels


def test_check_tells_the_error():
    model = sx.Model(K1, [AGGREGATION])
    ds = sx.solve(model, [1.0, 10.0], tolerance=1e-5, check=True)
    t = np.array([1.0, 10.0])
    for order, exact in ((0, 2 / (2 + t)), (2, 1 + t), (3, 1 + 3 * t + 1.5 * t**2)):
        error = np.abs(ds["moment"].sel(order=order).values[0] / exact - 1)
        assert (ds["error"] > error).all(), order
    assert (ds["error"] < 1e-3).all()
    with pytest.raises(InputError, match="check = 2"):
        sx.solve(model, [1.0], check=2)


def test_the_error_is_that_of_the_worst_moment(monkeypatch):
    model = sx.Model(K1)
    ds = sx.solve(model, [1.0], sizes=8)
    other = ds.copy(deep=True)
    other["moment"].loc[{"order": 3.0}] *= 1.001
    monkeypatch.setattr(
        "smolux.deterministic.solver.Run", lambda *_, **__: SimpleNamespace(dataset=lambda: other)
    )
    settings = SolverSettings((1.0,), orders=tuple(ds["order"].values), sizes=8)
    np.testing.assert_allclose(with_error(ds, model, settings)["error"], 1e-3, rtol=1e-9)


def test_former_names():
    model = sx.Model(K1)
    with pytest.warns(DeprecationWarning, match="largest is called window now"):
        old = sx.solve(model, [0.5], largest=100)
    new = sx.solve(model, [0.5], window=100)
    np.testing.assert_array_equal(old["moment"], new["moment"])
    with pytest.raises(InputError, match="are one argument"):
        sx.solve(model, [0.5], max_size=100, max_window=100)

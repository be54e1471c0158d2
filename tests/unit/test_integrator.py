"""Time steps, error control, the window of sizes, and the arguments of solve."""

from __future__ import annotations

import json

import numpy as np
import pytest

import smolux as sx
from smolux.deterministic import SolverError
from smolux.deterministic.encounters import Encounters
from smolux.deterministic.equations import Equations
from smolux.deterministic.integrate import Integrator, Norm
from smolux.deterministic.operator import OperatorFactory
from smolux.deterministic.radau import ORDER, STAGES, TABLEAU, extrapolate, radau_step
from smolux.deterministic.terms import Totals
from smolux.deterministic.timemesh import TimeMesh
from smolux.deterministic.window import Window
from smolux.errors import InputError, Interrupted, SmoluxWarning
from smolux.stochastic.make_plan import make_plan

AGGREGATION = sx.processes.Aggregation()


class Pendulum:
    """Swing and damping, not stiff: the iteration needs no Jacobian."""

    def rates(self, times, y):
        return np.stack([y[:, 1], -np.sin(y[:, 0])], axis=1), np.ones((len(y), 1))

    def jacobian(self, t, y, h):
        return np.zeros(2), np.zeros((2, 1))


class Fast:
    """``y' = -c (y - cos t) - sin t``: y = cos t, whatever c is."""

    c = 1e7

    def rates(self, times, y):
        return -self.c * (y - np.cos(times)[:, None]) - np.sin(times)[:, None], np.ones((len(y), 0))

    def jacobian(self, t, y, h):
        return np.array([self.c]), np.zeros((1, 1))


def plain(error, y):
    return float(np.abs(error).max())


def steps(problem, y, end, count):
    h = end / count
    before, along = None, 0.0
    for i in range(count):
        guess = np.zeros((STAGES, len(y))) if before is None else extrapolate(before, 1.0)
        start = problem.rates(np.array([i * h]), y[None])[0][0]
        step = radau_step(problem, i * h, y, h, start, guess, plain, 1e-11)
        y, before = y + step.change[-1], step.change
        along = along + step.along
    return y, along


def equations(kernel=None, rate=0.1, m=24, **settings):
    kernel = kernel or sx.kernels.Ballistic()
    model = sx.Model(kernel, [AGGREGATION, sx.processes.Shattering(rate)])
    return Equations(model, Encounters(model, "direct", 1e-9), m, 1.0, **settings)


def test_order_of_a_step():
    exact, _ = steps(Pendulum(), np.array([1.0, 0.0]), 4.0, 192)
    errors = [
        np.abs(steps(Pendulum(), np.array([1.0, 0.0]), 4.0, n)[0] - exact).max() for n in (12, 24)
    ]
    assert errors[0] / errors[1] > 2 ** (ORDER - 0.8)
    assert errors[1] < 1e-8


def test_what_is_integrated_along():
    assert steps(Pendulum(), np.array([1.0, 0.0]), 3.0, 12)[1][0] == pytest.approx(3.0, rel=1e-13)


def test_stiff_steps_are_stable_and_accurate():
    y, _ = steps(Fast(), np.array([1.0]), 4.0, 8)
    assert y[0] == pytest.approx(np.cos(4.0), abs=1e-6)


def test_tableau_is_radau_iia():
    for power in range(2 * STAGES - 1):
        total = TABLEAU.matrix[-1] @ TABLEAU.nodes**power
        assert total == pytest.approx(1 / (power + 1), rel=1e-12)
    assert TABLEAU.nodes[-1] == 1.0


def test_extrapolation_continues_polynomials():
    for power in range(1, STAGES + 1):
        change = (TABLEAU.nodes**power)[:, None]
        ahead = (1 + 0.7 * TABLEAU.nodes) ** power - 1
        np.testing.assert_allclose(extrapolate(change, 0.7)[:, 0], ahead, rtol=1e-11)


def test_norm_bounds_the_moments():
    sizes = np.arange(1.0, 101.0)
    n = np.exp(-sizes / 5)
    rng = np.random.default_rng(0)
    error = n * rng.normal(size=100)
    norm = Norm(np.array([0.5, 4.0]), sizes)
    for order in (0, 1, 2, 3, 4):
        relative = abs(error @ sizes**order) / (n @ sizes**order)
        assert relative <= norm(error, n) * (1 + 1e-12)
    assert norm(1e-3 * n, n) == pytest.approx(1e-3)
    # what is wrong with the largest sizes counts most in the highest moment
    wrong = n * (sizes > 90)
    assert norm(wrong, n) == pytest.approx(wrong @ sizes**4 / (n @ sizes**4))


def test_window_grows_in_time():
    window = Window(10_000, 3.0, 1e-8)
    sizes = np.arange(1.0, 401.0)
    operator = OperatorFactory(sx.kernels.Constant(), "direct", 1e-9)(400)

    def after(window, mean, step=0.1):
        n = np.exp(-sizes / mean)
        return window.next(400, window.share(n, operator.beyond(n)), 1.0, step)

    assert after(window, 5) == (400, False)
    largest, again = after(window, 12)
    assert 400 < largest < 800
    assert not again
    largest, again = after(window, 60)
    assert largest > 800
    assert again
    assert after(Window(400, 3.0, 1e-8), 60) == (400, False)
    assert Window(400, 3.0, 1e-8, fixed=True).first(1) == 400
    assert window.first(1000) >= 2000


def test_jacobian_bands():
    eq = equations(m=24)
    k = eq.sizes
    n = np.exp(-k / 4)
    K = eq.model.kernel(k[:, None], k[None, :])
    diagonal, band = eq.jacobian(0.0, n, 1e6)
    np.testing.assert_allclose(diagonal, 1.1 * K @ n, rtol=1e-12)
    for d in range(1, band.shape[1] + 1):
        # how the gain of the size l + d changes with the size l
        np.testing.assert_allclose(band[: 24 - d, d - 1], K[: 24 - d, d - 1] * n[d - 1])
    diagonal, band = eq.jacobian(0.0, n, 1e-6)
    assert band.shape[1] == 1
    np.testing.assert_allclose(diagonal, 1.1 * K[:, 0] * n[0], rtol=1e-12)


def test_gain_is_computed_once_or_not_at_all():
    eq = equations()
    calls = []
    gain = eq.encounters._operators[0].gain
    eq.encounters._operators[0].gain = lambda n: calls.append(len(n)) or gain(n)
    n = np.exp(-eq.sizes / 4)
    eq.rates(np.zeros(3), np.array([n, n, n]))
    assert calls == [3]
    model = sx.Model(eq.model.kernel, [sx.processes.Shattering(0.1)])
    alone = Equations(model, Encounters(model, "direct", 1e-9), 24, 1.0)
    alone.encounters._operators[0].gain = eq.encounters._operators[0].gain
    alone.rates(np.zeros(3), np.array([n, n, n]))
    assert calls == [3]


def test_rates_conserve_the_mass():
    eq = equations(m=200)
    n = np.exp(-eq.sizes / 4)
    rates, along = eq.rates(np.zeros(1), n[None])
    assert abs(rates[0] @ eq.sizes) < 1e-12 * (n @ eq.sizes)
    K = eq.model.kernel(eq.sizes[:, None], eq.sizes[None, :])
    totals = Totals.of(along[0])
    np.testing.assert_allclose(totals.events, np.array([0.5, 0.05]) * (n @ K @ n), rtol=1e-12)
    assert totals.number == pytest.approx(rates.sum(), rel=1e-12)
    assert totals.mass_in == totals.mass_out == 0.0


def test_mass_that_leaves_is_accounted_for():
    model = sx.Model(sx.kernels.Constant())
    with pytest.warns(SmoluxWarning, match="raise it"):
        ds = sx.solve(model, [1.0, 30.0], window=40)
    error = np.array(json.loads(ds.attrs["mass_error"]))
    assert json.loads(ds.attrs["window"]) == [40, 40]
    assert abs(error[0]) < 1e-8
    assert error[1] < -0.01
    np.testing.assert_allclose(ds["moment"].sel(order=1)[0] - 1, error, rtol=1e-12, atol=1e-15)
    # what is left, by an integrator that knows nothing of windows
    eq = Equations(model, Encounters(model, "direct", 1e-9), 40, 1.0)
    from scipy.integrate import solve_ivp

    def rhs(t, n):
        return eq.rates(np.array([t]), n[None])[0][0]

    end = solve_ivp(rhs, (0, 30), np.eye(40)[0], rtol=1e-10, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(ds["n"][0, 1, :40], end, rtol=1e-6, atol=1e-10)
    assert json.loads(ds.attrs["warnings"])


def test_capped_growth_warns():
    with pytest.warns(SmoluxWarning, match="raise max_window"):
        sx.solve(sx.Model(sx.kernels.Additive()), [2.0], max_window=200)


def test_what_comes_in_beyond_the_window_is_told():
    source = sx.processes.Source({3: 0.5, 50: 0.1})
    model = sx.Model(sx.kernels.Constant(1e-12), [sx.processes.Aggregation(), source])
    with pytest.warns(SmoluxWarning, match="leave out window"):
        ds = sx.solve(model, [2.0], window=40)
    np.testing.assert_allclose(ds["mass_in"], 13.0, rtol=1e-9)
    np.testing.assert_allclose(ds["moment"].sel(order=1), 4.0, rtol=1e-9)
    assert json.loads(ds.attrs["mass_beyond"]) == pytest.approx([10 / 14], rel=1e-9)


def test_pairs_beyond_the_window_fall_apart_with_all_their_mass():
    debris = sx.processes.CollisionalFragmentation(1.0, [3, 2, 1])
    model = sx.Model(sx.kernels.Constant(), [debris], sx.initial.monodisperse(0.1, 12))
    ds = sx.solve(model, [0.5, 2.0], window=16)
    np.testing.assert_allclose(ds["moment"].sel(order=1), 1.2, rtol=1e-8)
    assert np.all(ds["n"].sel(size=[1, 2, 3]) > 0)


def test_dataset():
    model = sx.Model(sx.kernels.Constant(), initial=sx.initial.exponential(5.0, density=2.0))
    ds = sx.solve(model, [0.0, 4.0], sizes=16, bins_per_octave=2, orders=(-0.5, 0, 1, 4))
    assert dict(ds.sizes)["replica"] == 1
    assert ds.attrs["complete"] == 1
    assert np.isnan(ds["particles"]).all()
    np.testing.assert_allclose(ds["volume"], 1.0)
    np.testing.assert_allclose(
        ds["n"].sum("size") + ds["n_bin"].sum("bin"), ds["number_density"], rtol=1e-12
    )
    np.testing.assert_allclose(ds["moment"].sel(order=0), ds["number_density"], rtol=1e-12)
    mass = ds["moment"].sel(order=1)[0] + 10.0 * np.array(json.loads(ds.attrs["mass_beyond"]))
    np.testing.assert_allclose(mass, 10.0, rtol=1e-12)
    np.testing.assert_allclose(json.loads(ds.attrs["mass_error"]), 0.0, atol=1e-8)
    # the bins of a simulation, as many as there is something in
    plan = make_plan(
        model,
        [1.0],
        method="inverse",
        particles=9,
        replicas=1,
        seed=1,
        orders=(0,),
        sizes=16,
        bins_per_octave=2,
    )
    np.testing.assert_array_equal(ds["bin_lower"], plan.grid.edges[: ds.sizes["bin"]])
    k = np.arange(1, 17)
    np.testing.assert_allclose(ds["n"][0, 0], 0.4 * 0.8 ** (k - 1), rtol=1e-12)
    # K = 1 keeps the exponential: M0 = 1 / (1 / M0(0) + t / 2)
    assert float(ds["number_density"][0, 1]) == pytest.approx(1 / (0.5 + 2), rel=1e-8)


def test_densities_are_never_negative():
    ds = sx.solve(sx.Model(sx.kernels.Brownian()), np.geomspace(0.01, 20, 12))
    assert (ds["n"] >= 0).all()
    assert (ds["n_bin"] >= 0).all()
    assert np.isfinite(ds["moment"]).all()


def test_progress_and_interruption(monkeypatch):
    monkeypatch.setattr("smolux.deterministic.solver._TICK", 0.0)
    seen = []

    def stop(progress):
        seen.append(progress)
        if progress.time > 2:
            raise KeyboardInterrupt

    model = sx.Model(sx.kernels.Brownian())
    with pytest.raises(Interrupted) as caught:
        sx.solve(model, [1.0, 20.0], progress=stop)
    assert [p.fraction for p in seen] == sorted(p.fraction for p in seen)
    ds = caught.value.dataset
    assert ds.attrs["complete"] == 0
    assert np.isfinite(ds["moment"][0, 0]).all()
    assert np.isnan(ds["moment"][0, 1]).all()


def test_failure_tells_the_time():
    model = sx.Model(sx.kernels.Constant(), [AGGREGATION, sx.processes.Shattering(0.1)])
    eq = Equations(model, Encounters(model, "direct", 1e-9), 64, 1.0)
    rates = eq.rates
    eq.rates = lambda times, n: tuple(
        np.where(times[:, None] < 0.5, part, np.nan) for part in rates(times, n)
    )
    mesh = TimeMesh(np.array([0.0, 1.0]))
    window = Window(64, 3.0, 1e-8, True)
    run = Integrator(eq, np.eye(64)[0], window, mesh, 1e-8, np.arange(4.0))
    with pytest.raises(SolverError, match=r"t = 0\.(49|5)") as caught:
        run.advance(1.0)
    assert 0.45 < caught.value.time <= 0.5


def test_negative_rate_is_a_mistake():
    model = sx.Model(sx.kernels.Constant(), [AGGREGATION, sx.processes.Shattering("0.1 * (1 - t)")])
    with pytest.raises(InputError, match=r"0\.1 \* \(1 - t\): is -.* at t = "):
        sx.solve(model, [3.0])


def test_all_mistakes_at_once():
    with pytest.raises(InputError) as caught:
        sx.solve(
            sx.Model(sx.kernels.Constant()),
            [2, 1],
            method="lowrank",
            tolerance=1.0,
            window=2.5,
            max_window=100,
            orders=[np.nan],
            sizes=0,
            gel="react",
        )
    text = "\n".join(caught.value.problems)
    for word in (
        "did you mean 'low-rank'",
        "did you mean 'reacts'",
        "tolerance = 1.0",
        "window = 2.5",
        "orders",
        "sizes = 0",
        "must ascend",
    ):
        assert word in text
    with pytest.raises(InputError, match="raise max_window"):
        sx.solve(
            sx.Model(sx.kernels.Constant(), initial=sx.initial.monodisperse(size=500)),
            [1],
            max_window=100,
        )
    with pytest.raises(InputError, match="aggregation alone"):
        sx.solve(equations().model, [1], gel="reacts")
    with pytest.raises(InputError, match="grows faster"):
        sx.solve(sx.Model(sx.kernels.Product(1.5)), [1], gel="reacts")


def test_rates_that_vary_do_not_gather_what_was_computed():
    """Each time has factors of its own; the rates of the kernel are found once for all of them."""
    eq, calls = equations(rate="0.1 + 0.05*sin(t)", m=300), []
    operator = eq.encounters._operators[0]
    columns = operator.columns
    operator.columns = lambda count: calls.append(count) or columns(count)
    n = 0.5 ** np.arange(1.0, 301.0)
    for t in np.linspace(0.0, 5.0, 40):
        loss, bands = eq.jacobian(float(t), n, 0.1)
    assert len(calls) <= 2
    # with the factors of the time: all partners, and those that merge
    near = eq.encounters.near([1.1 + 0.05 * np.sin(5.0)], n, bands.shape[1])
    np.testing.assert_allclose(loss, near, rtol=1e-12)
    np.testing.assert_allclose(bands, columns(bands.shape[1]) * n[: bands.shape[1]], rtol=1e-12)

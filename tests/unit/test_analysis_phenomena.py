"""Moments, oscillations, gelation and scaling."""

from pathlib import Path

import numpy as np
import pytest
import synthetic
import xarray as xr
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import smolux as sx
from shared import FORMULA
from smolux import analysis
from smolux.analysis.periodicity import chance_of_noise

DATA = Path(__file__).parents[1] / "reference" / "data"


def test_moments_from_sizes_and_bins():
    ds = synthetic.constant_dataset(particles=5000, times=(1.0, 30.0))
    found = analysis.moments(ds, orders=(-1, 0, 1, 2, 3))
    for p in (0, 1, 2, 3):
        exact = ds["moment"].sel(order=p)
        assert np.all(found["lower"].sel(order=p) <= exact * (1 + 1e-12))
        assert np.all(exact <= found["upper"].sel(order=p) * (1 + 1e-12))
        assert np.allclose(found["moment"].sel(order=p), exact, rtol=0.08)
    # where a bin holds a single size, too
    narrow = ds.assign_coords(
        bin=ds["bin_lower"].values, bin_upper=("bin", ds["bin_lower"].values + 1)
    )
    one = analysis.moments(narrow, orders=(-1, 2))
    for bound in ("lower", "upper"):
        assert np.allclose(one[bound], one["moment"], rtol=1e-12)
    # sum_k x**k / k is a logarithm
    solved, x = synthetic.solver_dataset(times=(30.0,)), 30 / 32
    inverse = analysis.moments(solved, orders=(-1,)).squeeze()
    exact = -np.log(1 - x) / x / 16**2
    assert inverse["lower"] < exact < inverse["upper"]
    # up to the largest size, all is exact
    assert np.allclose(found["moment"].sel(order=2, time=1), ds["moment"].sel(order=2, time=1))
    assert np.all(found["lower"].sel(order=-1) <= found["upper"].sel(order=-1))


def oscillating(curves, times):
    """Dataset in which the second moments are given curves."""
    ds = synthetic.constant_dataset(particles=30, replicas=len(curves), times=times)
    values = ds["moment"].values.copy()
    values[:, :, 2] = curves
    return ds.assign(moment=(ds["moment"].dims, values))


def test_extrema_between_the_samples():
    t = np.linspace(0, 20, 101)
    at, value, kind = analysis.extrema(t, np.cos(t - 0.123))
    # the first, at 0.123, is too near to the edge to stand out
    assert np.allclose(at, 0.123 + np.pi * np.arange(1, 7), atol=2e-5)
    assert np.allclose(value, (-1.0) ** np.arange(1, 7), atol=1e-6)
    assert kind.tolist() == [-1, 1, -1, 1, -1, 1]


def test_extrema_at_uneven_times_and_after_the_end():
    t = np.cumsum(np.random.default_rng(2).uniform(0.05, 0.3, 120))
    y = np.sin(t)
    y[80:] = np.nan
    at, _, _ = analysis.extrema(t, y)
    assert np.allclose(np.mod(at, np.pi), np.pi / 2, atol=1e-3)
    assert at.max() < t[80]


def test_limit_cycle_against_the_reference():
    # generalised Brownian kernel, a = 0.95, shattering 0.01: extrema of M2 from rate equations
    data = np.genfromtxt(DATA / "oscillation_a0.95_lambda0.01.csv", delimiter=",", names=True)
    found = analysis.oscillations(oscillating(data["M2"][None], data["t"]))
    known_time = [42.275, 56.310, 80.478, 93.100, 115.376]
    known_value = [140.568, 87.037, 127.908, 89.172, 126.570]
    assert np.allclose(found["extremum_time"][0, :5], known_time, atol=2e-3)
    assert np.allclose(found["extremum_value"][0, :5], known_value, atol=2e-3)
    # the limit cycle: period 33.694, M2 from 92.541 to 124.752, distance falls by 0.63 a period
    assert float(found["period"][0]) == pytest.approx(33.694, abs=0.1)
    assert float(found["amplitude_limit"][0]) == pytest.approx((124.752 - 92.541) / 2, rel=0.005)
    assert float(found["contraction"][0]) == pytest.approx(0.63, abs=0.05)
    assert found["verdict"].values.tolist() == ["persistent"]


@pytest.mark.parametrize(
    ("rate", "verdict"),
    [(0.0, "persistent"), (0.002, "decaying"), (0.01, "decaying"), (0.1, "none")],
)
def test_whether_oscillations_last(rate, verdict):
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 300.0)
    curve = 100 + 40 * np.exp(-rate * t) * np.cos(2 * np.pi * t / 33)
    curves = curve + rng.standard_normal((6, len(t)))
    found = analysis.oscillations(oscillating(curves, t))
    assert found["verdict"].values.tolist() == [verdict] * 6
    if rate == 0.0:
        assert found.attrs["amplitude"] == pytest.approx(40, abs=1)
    if rate < 0.01:
        assert found.attrs["period"] == pytest.approx(33, abs=0.1)
        assert found.attrs["period_error"] < 0.2


def test_noise_alone_does_not_oscillate():
    noise = np.random.default_rng(8).standard_normal((5, 300))
    found = analysis.oscillations(oscillating(10 + noise, np.arange(300.0)))
    assert set(found["verdict"].values) == {"none"}
    assert np.isnan(found.attrs["period"])


def autoregressive(replicas, times, rho, seed):
    """Noise that forgets what it was by a factor `rho` from time to time."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((times, replicas))
    y = np.empty_like(noise)
    y[0] = noise[0] / np.sqrt(1 - rho**2)
    for k in range(1, times):
        y[k] = rho * y[k - 1] + noise[k]
    return y.T


@pytest.mark.parametrize("rho", [0.8, 0.95])
def test_the_noise_of_an_equilibrium_does_not_last(rho):
    t = np.arange(400.0)
    found = analysis.oscillations(oscillating(100 + autoregressive(40, 400, rho, 5), t))
    assert np.isin(found["verdict"].values, ["noise", "none", "undecided"]).mean() >= 0.95
    assert np.count_nonzero(found["verdict"] == "noise") > 10
    # the same noise on top of a swing of its own size, whose phase drifts
    drift = np.cumsum(np.random.default_rng(6).standard_normal((10, 400)) * 0.05, axis=1)
    swing = 3 * np.sin(2 * np.pi * t / 33 + drift) / np.sqrt(1 - rho**2)
    found = analysis.oscillations(oscillating(100 + swing + autoregressive(10, 400, rho, 7), t))
    assert np.all(found["chance"] < 1e-3)


def test_noise_without_a_period_is_taken_for_one_as_often_as_said():
    """Also where it is slow beside the series, and its correlation comes out too small."""
    t = np.arange(100.0)
    chance = np.array([chance_of_noise(t, y) for y in autoregressive(1000, 100, 0.95, 5)])
    assert 0.03 < np.mean(chance < 0.05) < 0.1
    assert 0.005 < np.mean(chance < 0.01) < 0.03


def test_an_equilibrium_of_few_particles_has_no_period():
    """500 particles under shattering; each replica swings by a tenth of its mean."""
    kernel = sx.kernels.formula(FORMULA, c0=1.0, c1=0.0, c2=0.0, c3=0.0)
    model = sx.Model(kernel, [sx.processes.Aggregation(), sx.processes.Shattering(0.1)])
    ds = sx.simulate(
        model, np.arange(0.0, 401.0), method="acceptance-rejection", particles=500, replicas=8,
        seed=1, sizes=8,
    )  # fmt: skip
    for start in (0.0, 50.0):
        found = analysis.oscillations(ds, start=start)
        assert not np.isin(found["verdict"].values, ["persistent", "decaying"]).any()


def test_too_few_times():
    ds = oscillating(np.ones((1, 10)), np.arange(10.0))
    with pytest.raises(sx.InputError, match="fewer than 5"):
        analysis.oscillations(ds, start=7.0)


def test_series_names_what_there_is():
    ds = synthetic.constant_dataset(replicas=2)
    assert analysis.series(ds, "events", process="aggregation").equals(
        ds["events"].sel(process="aggregation", drop=True)
    )
    with pytest.raises(sx.InputError, match="did you mean 'moment'"):
        analysis.series(ds, "momnet")
    with pytest.raises(sx.InputError, match=r"order = 5: .*0\.0, 1\.0, 2\.0, 3\.0"):
        analysis.series(ds, "moment", order=5)
    with pytest.raises(sx.InputError, match="1 to 64"):
        analysis.series(ds, "n", size=65)


def denser(ds, factor):
    """The same particles in a smaller volume: all that is per volume is more, and comes sooner."""
    ds = ds.assign(volume=ds["volume"] / factor).assign_coords(time=ds["time"] / factor)
    return ds.assign({name: factor * ds[name] for name in ("number_density", "moment")})


def random_graph(particles, times, replicas, seed=1):
    """Components of growing random graphs: the exact process of the multiplicative kernel."""
    rng = np.random.default_rng(seed)
    shape = (replicas, len(times))
    moment, largest = np.empty((*shape, 4)), np.empty(shape)
    p = -np.expm1(-times[-1] / particles)
    for r in range(replicas):
        edges = rng.binomial(particles * (particles - 1) // 2, p)
        ends = rng.integers(0, particles, (2, edges))
        clock = -particles * np.log1p(-p * rng.random(edges))
        for k, t in enumerate(times):
            i, j = ends[:, clock <= t]
            graph = coo_matrix((np.ones(len(i)), (i, j)), (particles, particles))
            sizes = np.bincount(connected_components(graph, directed=False)[1]).astype(float)
            moment[r, k] = [np.sum(sizes**q) / particles for q in range(4)]
            largest[r, k] = sizes.max()
    tracks = ("replica", "time")
    return xr.Dataset(
        {
            "moment": ((*tracks, "order"), moment),
            "number_density": (tracks, moment[..., 0]),
            "particles": (tracks, moment[..., 0] * particles),
            "largest": (tracks, largest),
            "volume": (tracks, np.full(shape, float(particles))),
        },
        {"time": times, "order": [0.0, 1.0, 2.0, 3.0]},
    )


@pytest.mark.parametrize("times", [9, 41])
def test_gel_time_and_gel_of_the_multiplicative_kernel(times):
    """Whatever the output times are, one is within two of the errors that are given."""
    ds = random_graph(20_000, np.linspace(0, 2, times), 6)
    found = analysis.gelation(ds)
    error = found.attrs["gel_time_error"]
    assert found.attrs["gel_time"] == pytest.approx(1.0, abs=2 * error)
    assert found.attrs["gel_time_grid"] == pytest.approx(2 / (times - 1) / np.sqrt(12))
    # N**(-1/3): of the moments of the orders 2 and 3, or of the number of clusters without them
    for each in (ds, ds.sel(order=[0, 1, 2])):
        assert analysis.gelation(each).attrs["gel_time_finite"] == pytest.approx(
            found.attrs["gel_time"] * 20_000 ** (-1 / 3), rel=1e-6
        )
    assert error < (0.06 if times == 41 else 0.1)
    share = found["gel_fraction"].mean("replica")
    assert float(share[0]) == 1 / 20_000
    assert float(share[-1]) == pytest.approx(1 - 0.203187869980, abs=0.01)
    # two and a half times as dense, all comes as much sooner
    dense = analysis.gelation(denser(ds, 2.5))
    assert np.allclose(dense["gel_fraction"], found["gel_fraction"], rtol=1e-12)
    assert np.allclose(dense["gel_time"], found["gel_time"] / 2.5, rtol=1e-12)
    for name, value in found.attrs.items():
        assert dense.attrs[name] == pytest.approx(value / 2.5, rel=1e-9)


def test_a_peak_between_uneven_times():
    ds = random_graph(50, np.array([0.0, 0.2, 1.0, 1.5, 3.0]), 1)
    ds["largest"][:] = 0.0
    ds["number_density"][:] = 1.0
    ds["moment"].loc[{"order": 2.0}] = 5 - (ds["time"] - 1.1) ** 2
    assert float(analysis.gelation(ds)["gel_time"][0]) == pytest.approx(1.1, rel=1e-12)


def test_the_end_of_a_finite_system_is_no_gel():
    times = np.linspace(0, 200, 101)
    ds = synthetic.constant_dataset(particles=1000, times=times)
    assert np.isnan(analysis.gelation(ds)["gel_time"]).all()
    # also where nobody knows whether the kernel gels
    ds.attrs["model"] = "unknown"
    assert np.isnan(analysis.gelation(ds)["gel_time"]).all()


@pytest.mark.filterwarnings("ignore:.*after gelation this is the gel")
def test_gel_and_mass_that_is_removed():
    """K = i j from triplets gels at 1/3; n and M2 before, and the mass of the gel behind."""
    model = sx.Model(kernel=sx.kernels.Multiplicative(), initial=sx.initial.monodisperse(1 / 3, 3))
    late = sx.solve(model, np.array([0.4, 0.5, 0.6]), sizes=8, max_size=1024)
    share = analysis.gel_fraction(late).values[0]
    # Stockmayer: the mass of the sol falls as 1 / (3 t)
    assert np.allclose(share, 1 - 1 / (3 * late["time"].values), atol=1e-3)
    for times in (np.linspace(0, 0.33, 12), np.linspace(0, 0.5, 51)):
        found = analysis.gelation(sx.solve(model, times, sizes=8, max_size=1024)).attrs
        assert found["gel_time"] == pytest.approx(1 / 3, abs=1e-4)
        assert abs(found["gel_time"] - 1 / 3) < 4 * found["gel_time_error"] + 1e-5
    removal = [sx.processes.Aggregation(), sx.processes.Removal("0.5")]
    gone = sx.solve(sx.Model(sx.kernels.Constant(), removal), [0.0, 1.0, 2.0])
    assert np.allclose(analysis.gel_fraction(gone), 0.0, atol=1e-7)


def test_gel_time_from_rate_equations():
    for gel_time, power in ((1.0, 1.0), (2.5, 0.7)):
        t = np.linspace(0, 0.95 * gel_time, 40)
        ds = synthetic.solver_dataset(times=t)
        ds["moment"].loc[{"order": 2.0}] = (1 - t / gel_time) ** -power
        assert analysis.gelation(ds).attrs["gel_time"] == pytest.approx(gel_time, rel=0.01)


def test_gel_time_from_a_few_times():
    ds = synthetic.solver_dataset(times=[0.2, 0.4, 0.6, 0.8, 0.9])
    ds["moment"].loc[{"order": 2.0}] = 1 / (1 - ds["time"].values)
    assert analysis.gelation(ds).attrs["gel_time"] == pytest.approx(1, abs=0.03)


def test_no_gel_where_none_is():
    late = synthetic.constant_dataset(particles=300, times=np.geomspace(0.1, 1e5, 40))
    assert np.isnan(analysis.gelation(late)["gel_time"]).all()
    assert np.isnan(analysis.gelation(synthetic.solver_dataset())["gel_time"]).all()
    with pytest.raises(sx.InputError, match="none of the order 2"):
        analysis.gelation(late.sel(order=[0.0, 1.0]))


def test_scaling_of_the_constant_kernel():
    # far from the start, 4 exp(-2 x); here s = 1 + t, which is t up to 1/t
    ds = synthetic.solver_dataset(times=(0.0, 100.0, 300.0))
    found = analysis.scaling(ds)
    assert found["mean_size"].values.tolist() == [1, 101, 301]
    for t, accuracy in ((100.0, 0.03), (300.0, 0.02)):
        at = found.sel(time=t)
        near = (at["x"] < 1).values
        assert np.allclose(at["phi"][near], 4 * np.exp(-2 * at["x"][near]), rtol=accuracy)
    x, phi = found.sel(time=100.0)["x"].values, found.sel(time=100.0)["phi"].values
    assert np.trapezoid(x * phi, x) == pytest.approx(1, abs=0.02)
    assert np.trapezoid(x**2 * phi, x) == pytest.approx(1, abs=0.02)
    assert np.interp(1.0, x, phi) == pytest.approx(4 * np.exp(-2), rel=0.03)
    # three times as dense, and the longer the less so: the form is the same
    mass = 3 / (1 + ds["time"])
    other = ds.assign({name: mass * ds[name] for name in ("moment", "n", "n_bin")})
    assert np.allclose(analysis.scaling(other)["phi"], found["phi"], rtol=1e-12, equal_nan=True)
    # at the start only monomers: the rest is left out, not zero
    assert np.isnan(found.sel(time=0.0)["phi"].values[1:]).all()

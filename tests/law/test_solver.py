"""The rate equations against exact solutions and independent reference values."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

import smolux as sx
from smolux import analysis
from smolux.errors import SmoluxWarning

DATA = Path(__file__).parents[1] / "reference" / "data"
AGGREGATION = sx.processes.Aggregation()


def rows(name):
    with (DATA / name).open() as file:
        return list(csv.DictReader(file))


def shattered(kernel, rate, **initial):
    return sx.Model(kernel, [AGGREGATION, sx.processes.Shattering(rate)], **initial)


def observed(ds, t, what):
    at = ds.isel(replica=0).sel(time=t)
    if what.startswith("n_"):
        return float(at["n"].sel(size=int(what[2:])))
    if what == "M1sol":
        return float(at["moment"].sel(order=1))
    return float(at["moment"].sel(order=float(what[1:])))


def spot_values(case):
    """Exact values of a case by parameters: ``{params: [(t, observable, exact)]}``."""
    found = {}
    for row in rows("exact_spot_values.csv"):
        if row["case"].split()[0] == case and not row["observable"].startswith("res"):
            value = float(row["t"]), row["observable"], float(row["exact"])
            found.setdefault(row["params"], []).append(value)
    assert found
    return found


def model_of(case, params):
    if case == "E4":
        a, b = re.findall(r"[AB]=([\d.]+)", params)
        return sx.Model(sx.kernels.Bilinear(float(a), float(b)))
    if case == "E5":
        return shattered(sx.kernels.Constant(), float(params.removeprefix("lam=")))
    kernels = {
        "E1": sx.kernels.Constant(),
        "E2": sx.kernels.Additive(scale=0.5),
        "E3": sx.kernels.Multiplicative(),
    }
    return sx.Model(kernels[case])


@pytest.mark.parametrize("case", ["E1", "E2", "E3", "E4", "E5"])
def test_exact_solutions(case):
    for params, values in spot_values(case).items():
        ds = sx.solve(model_of(case, params), sorted({t for t, _, _ in values}))
        for t, what, exact in values:
            assert observed(ds, t, what) == pytest.approx(exact, rel=1e-6), (params, t, what)


def test_mass_is_conserved():
    ds = sx.solve(shattered(sx.kernels.Ballistic(), 0.01), [0.1, 1, 10])
    mass, beyond = ds["moment"].sel(order=1).values[0], json.loads(ds.attrs["mass_beyond"])
    # by what it was said to leave the window, far below the tolerance, and no more
    np.testing.assert_allclose(mass + beyond, 1.0, rtol=1e-13)
    assert max(beyond) < 1e-10
    assert max(np.abs(json.loads(ds.attrs["mass_error"]))) < 1e-10
    assert abs(ds.attrs["mass_defect"]) < 1e-13


def test_collisions_of_each_process():
    # spec X3: events per unit volume for K = 1 with shattering
    ds = sx.solve(shattered(sx.kernels.Constant(), 0.1), [10, 100])
    np.testing.assert_allclose(ds["collisions"][0], [1.0669329668, 2.5653961362], rtol=1e-9)
    events = ds["events"][0]
    np.testing.assert_allclose(
        events.sel(process="shattering"), 0.1 * events.sel(process="aggregation"), rtol=1e-12
    )
    # aggregation alone: each removes one cluster
    ds = sx.solve(sx.Model(sx.kernels.Brownian()), [3.0])
    assert float(ds["collisions"][0, 0]) == pytest.approx(
        1 - float(ds["number_density"][0, 0]), rel=1e-9
    )


def test_ballistic_with_shattering():
    table = [r for r in rows("ballistic_shatter_lam0.01_moments.csv") if float(r["t"]) <= 10]
    ds = sx.solve(
        shattered(sx.kernels.Ballistic(), 0.01), [float(r["t"]) for r in table], sizes=5000
    )
    for row in table:
        for what in ("M0", "M1", "M2", "M3"):
            assert observed(ds, float(row["t"]), what) == pytest.approx(float(row[what]), rel=1e-8)
    for row in rows("ballistic_shatter_lam0.01_nk.csv"):
        for t in (1, 10):
            exact = float(row[f"n_k(t={t})"] or 0)
            if exact > 1e-13 and int(row["k"]) <= 5000:
                found = observed(ds, float(t), f"n_{row['k']}")
                assert found == pytest.approx(exact, rel=1e-6), (row["k"], t)


@pytest.mark.parametrize(("kernel", "end"), [("brownian", 100), ("ballistic", 20)])
def test_pure_aggregation(kernel, end):
    table = [
        r for r in rows("aggregation_moments.csv") if r["kernel"] == kernel and float(r["t"]) <= end
    ]
    ds = sx.solve(
        sx.Model(sx.kernels.by_name(kernel)()),
        [float(r["t"]) for r in table],
        orders=(0, 1 / 3, 2 / 3, 2, 3),
    )
    columns = ["M0", "M_1/3", "M_2/3", "M2", "M3"]
    exact = [[float(r[c]) for c in columns] for r in table]
    np.testing.assert_allclose(ds["moment"][0], exact, rtol=1e-8)


def test_oscillations():
    # reference/osc_a0.95_lam0.01_mono.csv
    exact = {
        10.0: (0.05648612, 35.1301144, 0.00446512658),
        20.0: (0.0298312562, 70.4943521, 0.00389430178),
        40.0: (0.0637203201, 137.984986, 0.0493315578),
        60.0: (0.0878760857, 90.4491542, 0.0462743155),
    }
    ds = sx.solve(shattered(sx.kernels.GeneralizedBrownian(0.95), 0.01), list(exact))
    for t, values in exact.items():
        found = [observed(ds, t, what) for what in ("M0", "M2", "n_1")]
        np.testing.assert_allclose(found, values, rtol=1e-6)


def test_time_dependent_shattering():
    # reference/osc_a0.9_lamramp_poly.csv
    model = shattered(
        sx.kernels.GeneralizedBrownian(0.9),
        "0.01 * (1 - t/400)",
        initial=sx.initial.from_sizes(dict.fromkeys(range(1, 11), 0.1)),
    )
    ds = sx.solve(model, [5, 10, 15])
    np.testing.assert_allclose(
        ds["moment"].sel(order=2)[0], [512.665958, 729.524129, 686.826737], rtol=1e-6
    )
    np.testing.assert_allclose(
        ds["number_density"][0], [0.134914199, 1.23586895, 0.436591175], rtol=1e-6
    )
    mass = ds["moment"].sel(order=1)[0] + 5.5 * np.array(json.loads(ds.attrs["mass_beyond"]))
    np.testing.assert_allclose(mass, 5.5, rtol=1e-12)


def test_gel_that_reacts_follows_flory():
    """At the density 2.5 and K = 0.4 i j: as for 1 and i j, but 2.5 times as much of all."""
    values = [v for group in spot_values("E3F").values() for v in group]
    model = sx.Model(sx.kernels.Multiplicative(0.4), initial=sx.initial.monodisperse(2.5))
    with pytest.warns(SmoluxWarning, match="Flory"):
        ds = sx.solve(model, [1.5, 2.0], gel="reacts", max_window=512)
    for t, what, exact in values:
        assert observed(ds, t, what) == pytest.approx(2.5 * exact, rel=1e-6), (t, what)
    # each collision takes one cluster away, also with the gel; of two that make one beyond the
    # window both are gone
    np.testing.assert_allclose(ds["collisions"], 2.5 - ds["number_density"], rtol=2e-4)
    share = analysis.gel_fraction(ds).values[0]
    np.testing.assert_allclose(share, 1 - np.exp(-ds["time"] * share), rtol=1e-6)


def test_inert_gel_follows_stockmayer():
    with pytest.warns(SmoluxWarning, match="Stockmayer"):
        ds = sx.solve(sx.Model(sx.kernels.Multiplicative()), [1.5, 2.0], max_window=1024)
    np.testing.assert_allclose(ds["moment"].sel(order=1)[0], [1 / 1.5, 1 / 2], rtol=1e-6)
    exact = sx.summary(ds)["moment"].sel(statistic="exact", order=1)
    np.testing.assert_allclose(exact, [1 / 1.5, 1 / 2], rtol=1e-12)
    # the densities at the gel time over t, but for the truncation: an error of order M**-3/2 x M
    np.testing.assert_allclose(ds["number_density"][0], [1 / 3, 1 / 4], rtol=5e-3)


@pytest.mark.parametrize("kernel", [sx.kernels.Sedimentation(), sx.kernels.Ballistic()])
def test_direct_sum_agrees_with_auto(kernel):
    model = shattered(kernel, 0.05, initial=sx.initial.exponential(3.0))
    a = sx.solve(model, [0.02, 0.05], method="direct")
    b = sx.solve(model, [0.02, 0.05])
    assert a.attrs["operator"] == "direct"
    assert b.attrs["operator"] == ("direct" if kernel.name == "sedimentation" else "low-rank")
    np.testing.assert_allclose(a["moment"], b["moment"], rtol=1e-7)


def test_density_and_prefactor_scale_the_time():
    kernel = sx.kernels.Brownian
    a = sx.solve(sx.Model(kernel()), [1.0, 4.0])
    b = sx.solve(sx.Model(kernel(scale=1e-16), initial=sx.initial.monodisperse(1e12)), [1e4, 4e4])
    np.testing.assert_allclose(b["moment"] / 1e12, a["moment"], rtol=1e-9)
    np.testing.assert_allclose(b["collisions"] / 1e12, a["collisions"], rtol=1e-9)


def test_density_does_not_depend_on_the_output_times():
    model = shattered(sx.kernels.GeneralizedBrownian(0.9), 0.02)
    few = sx.solve(model, [5.0])
    many = sx.solve(model, np.linspace(0.0, 5.0, 101))
    np.testing.assert_allclose(many["moment"].sel(time=5), few["moment"].sel(time=5), rtol=1e-8)


def test_tolerance_controls_the_error():
    exact = 0.0637203201  # M0 at t = 40, where it grows fastest
    model = shattered(sx.kernels.GeneralizedBrownian(0.95), 0.01)
    for tolerance in (1e-4, 1e-6):
        ds = sx.solve(model, [40.0], tolerance=tolerance)
        error = abs(float(ds["number_density"][0, 0]) / exact - 1)
        assert error < 10 * tolerance


@pytest.mark.parametrize("method", ["direct", "low-rank"])
@pytest.mark.parametrize(
    ("varying", "clock"),
    [
        ("1 + t", lambda t: t + t**2 / 2),
        (0.4, lambda t: 0.4 * t),
        (lambda t: float(t < 1), lambda t: min(t, 1.0)),
    ],
)
def test_aggregation_that_varies_in_time(method, varying, clock) -> None:
    """It is aggregation in another time: ``n_k = 4/(s+2)**2 (s/(s+2))**(k-1)`` for K = 1."""
    model = sx.Model(sx.kernels.Constant(), sx.processes.Aggregation(varying=varying))
    times, k = [0.5, 2.0], np.arange(1, 30)
    ds = sx.solve(model, times, method=method, tolerance=1e-8)
    for t in times:
        s = clock(t)
        expected = 4 / (s + 2) ** 2 * (s / (s + 2)) ** (k - 1.0)
        found = ds["n"].sel(time=t, size=k).values[0]
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)
        assert ds["number_density"].sel(time=t).item() == pytest.approx(2 / (2 + s), rel=1e-7)


@pytest.mark.filterwarnings("ignore:.*beyond the 400 sizes:smolux.errors.SmoluxWarning")
def test_a_gel_takes_up_at_a_rate_that_varies() -> None:
    """K = ij, monomers: ``n_1 = exp(-s)`` also beyond the gel time, with a gel that reacts."""
    model = sx.Model(sx.kernels.Multiplicative(), sx.processes.Aggregation(varying="2 * t"))
    times = np.array([0.8, 1.4])
    ds = sx.solve(model, times, gel="reacts", window=400, tolerance=1e-8)
    np.testing.assert_allclose(ds["n"].sel(size=1).values[0], np.exp(-(times**2)), rtol=1e-6)

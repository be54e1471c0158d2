"""The solver against an independent reference (`verification.solver.reference`).

The reference is itself held to closed forms and to another integrator. The whole matrix is in
`verification/solver`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solving import CLOSE, I, P, cell, slow, solved, with_
from verification.solver import closed, judge, matrix, reference
from verification.solver.axes import KERNELS, PROCESSES, STARTS, VARYING
from verification.solver.cells import alone, mixed, timed, unique
from verification.suite import plain

import smolux as sx

# The reference itself


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda k: k.name)
def test_reference_sums_over_all_pairs(kernel, monkeypatch):
    k = np.arange(1.0, 31.0)
    n = np.random.default_rng(14).random(30) * np.exp(-k)
    loss, gain = reference.slow_sums(kernel.law, n)
    given = kernel.kernel(k[:, None], k[None, :])
    np.testing.assert_allclose(kernel.law.rate(k[:, None], k[None, :]), given, rtol=1e-14)
    for most in (1500, 0):  # plain sums, transforms
        monkeypatch.setattr(reference, "_MATRIX", most)
        sums = reference.Sums(kernel.law, 30)
        np.testing.assert_allclose(sums.loss(n), loss, rtol=1e-13)
        np.testing.assert_allclose(sums.gain(n), gain, rtol=1e-11, atol=1e-22)


def test_reference_fragments():
    # of a mass of 2 with shares 3 and 2: a dimer with 2/5, else two monomers; of 3 by hand
    found = reference.fragments((3, 2), 3)
    np.testing.assert_allclose(found[:2], [[1, 0], [2 * 3 / 5, 2 / 5]], rtol=1e-15)
    np.testing.assert_allclose(found[2], [3 / 5 * (1 + 6 / 5) + 2 / 5, 3 / 5 * 2 / 5 + 2 / 5])
    masses = np.arange(1, 41)
    np.testing.assert_allclose(reference.fragments((3, 2, 1), 40) @ [1, 2, 3], masses, rtol=1e-14)


@pytest.mark.parametrize(
    ("start", "process", "coefficients"),
    [
        ("20", "shattering", lambda s, mass: (0.0, 0.3 * mass, 0.8)),
        ("monomers", "scission", lambda s, mass: (0.4 * mass / s.time, -0.4 / s.time, 0.5)),
        ("3, 7 and 50", "dilution", lambda s, mass: (0.0, -0.5 / s.time, 0.5)),
        ("2", "source", lambda s, mass: (0.5 / s.time, 0.0, 0.5)),
        ("empty", "source", lambda s, mass: (0.5 / s.time, 0.0, 0.5)),
    ],
)
def test_reference_against_closed_forms(start, process, coefficients):
    case = cell(start, "constant", process)
    exact = reference.solve(case.problem, case.times)
    n = case.start.densities(exact.window)
    mass = float(n @ np.arange(1.0, len(n) + 1.0))
    for t, found in zip(case.times, exact.moment[:, 0], strict=True):
        right = closed.riccati(float(n.sum()), *coefficients(case.scale, mass), t)
        assert found == pytest.approx(right, rel=1e-10)
    np.testing.assert_allclose(
        exact.moment[:, 1], mass + exact.mass_in - exact.mass_out, rtol=1e-10
    )


@pytest.mark.parametrize("varying", ["ramp", "pulse", "box", "periodic"])
def test_reference_against_closed_forms_of_time(varying):
    case = cell("2", "constant", "dilution", varying=varying)
    problem, end = case.problem, case.times[-1]
    exact = reference.solve(problem, case.times)
    factor = problem.unary[0].factor
    right = closed.diluted_number(1.0, lambda t: 0.5 / end * factor(t), end, problem.breaks)
    assert exact.moment[-1, 0] == pytest.approx(right, rel=1e-9)


def test_reference_with_another_integrator():
    case = cell("2", "Brownian", "shattering", "evaporation", varying="ramp")
    problem = replace(case.problem, cut=12)
    a = reference.solve(problem, case.times)
    b = reference.solve(problem, case.times, method="LSODA")
    np.testing.assert_allclose(b.moment, a.moment, rtol=1e-9)
    np.testing.assert_allclose(b.n, a.n, atol=1e-9)
    np.testing.assert_allclose(b.mass_out, a.mass_out, atol=1e-9)


# The matrix, some of it

FAST = [
    ("monomers", "constant", ("shattering",), "pulse"),
    ("monomers", "ballistic", ("evaporation", "source"), "box"),
    ("monomers", "additive", ("removal above",), "none"),
    ("2", "Brownian", ("debris",), "ramp"),
    ("2", "formula", ("scission", "dilution"), "periodic"),
    ("20", "constant", ("breakage",), "box"),
    ("20", "Brownian", ("source of large",), "none"),
    ("32", "formula", ("evaporation",), "none"),
    ("33", "ballistic", (), "none"),
    ("47", "Brownian", ("deposition",), "pulse"),
    ("100", "constant", ("evaporation",), "none"),
    ("1 and 100", "multiplicative", (), "none"),
    ("1, few of 60", "additive", ("dilution",), "periodic"),
    ("3, 7 and 50", "additive", ("removal above",), "none"),
    ("95 to 105", "multiplicative", (), "none"),
    ("exponential 10", "formula", ("debris", "evaporation"), "ramp"),
    ("lognormal 100, 1.05", "constant", ("source",), "none"),
    ("lognormal 20, 2", "Brownian", (), "none"),
    ("empty", "ballistic", ("source",), "ramp"),
    ("empty", "constant", ("source of both", "removal above"), "pulse"),
]
#: those that take longest
DEAR = [
    ("20", "constant", ("breakage",), "box"),
    ("33", "ballistic", (), "none"),
    ("100", "constant", ("evaporation",), "none"),
    ("monomers", "ballistic", ("evaporation", "source"), "box"),
    ("2", "formula", ("scission", "dilution"), "periodic"),
    ("32", "formula", ("evaporation",), "none"),
    ("47", "Brownian", ("deposition",), "pulse"),
    ("1, few of 60", "additive", ("dilution",), "periodic"),
    ("empty", "constant", ("source of both", "removal above"), "pulse"),
]


@pytest.mark.parametrize(
    "at", [pytest.param(k, marks=slow if c in DEAR else []) for k, c in enumerate(FAST)],
    ids=[" ".join((c[0], c[1], *c[2], c[3])) for c in FAST],
)  # fmt: skip
def test_cells_of_the_matrix(at):
    start, kernel, processes, varying = FAST[at]
    case = cell(start, kernel, *processes, varying=varying)
    exact = reference.solve(case.problem, case.times)
    small = exact.window <= 1000
    ds = solved(case.model, case.times, method=("low-rank", "direct")[at % 2 if small else 0])
    errors = judge.compare(ds, exact)
    assert max(errors.values()) < CLOSE, errors


# Two windows, two tolerances

TWICE = {
    "47": with_(kernel=sx.kernels.Ballistic(), initial=I.monodisperse(size=47)),
    "shattered": with_(P.Shattering(0.2), kernel=sx.kernels.Ballistic()),
    "lognormal": with_(kernel=sx.kernels.Brownian(), initial=I.lognormal(20, 1.5)),
    "open": with_(P.Source({1: 1.0, 90: 0.01}), P.Removal("0.2*sqrt(k)"), initial=I.empty()),
    "pulse": with_(P.Evaporation(0.3), P.Source(1.0, varying="9*exp(-((t-0.3)/0.01)**2)")),
}
TWICE_QUICK = [pytest.param(k, marks=[] if k in ("47", "open") else slow) for k in TWICE]


def same(ds, exact, tolerance):
    for what in ("moment", "events"):
        scale = exact[what].max("time")  # before the pulse there is exp(-100) of it
        np.testing.assert_allclose(ds[what] / scale, exact[what] / scale, tolerance, atol=1e-40)


@pytest.mark.parametrize("name", TWICE_QUICK)
def test_tolerance_is_the_error(name):
    times = [0.2, 0.6]
    exact = solved(TWICE[name], times, tolerance=1e-10)
    for tolerance in (1e-4, 1e-6, 1e-8):
        ds = solved(TWICE[name], times, tolerance=tolerance)
        same(ds, exact, 10 * tolerance)


@pytest.mark.parametrize("name", TWICE_QUICK)
def test_window_does_not_matter(name):
    times = [0.2, 0.6]
    chosen = solved(TWICE[name], times)
    for window in (12_000, 18_000):
        ds = solved(TWICE[name], times, window=window, method="low-rank")
        same(ds, chosen, CLOSE)


# The verification


def test_matrix_is_complete():
    fed = [s.name for s in STARTS[:-1]]
    cells = unique(alone(), timed(), mixed())
    assert {(c.start.name, c.kernel.name) for c in cells if not c.processes} == {
        (s, k.name) for s in fed for k in KERNELS
    }
    met = {(c.start.name, p.name) for c in cells for p in c.processes}
    assert met >= {(s, p.name) for s in fed for p in PROCESSES}
    met = {(c.processes[0].name, c.varying.name) for c in cells if c.processes}
    assert met >= {(p.name, v.name) for p in PROCESSES if p.cut is None for v in VARYING}
    met = {frozenset(p.name for p in c.processes) for c in cells}
    assert met >= {
        frozenset((a.name, b.name)) for a in PROCESSES for b in PROCESSES if a.family != b.family
    }


def one_cell():
    """Return a cell, to processes that take functions by their name."""
    return [cell("monomers", "constant")]


def test_verification_tells_right_from_wrong():
    data = plain(matrix.compute(one_cell, quick=False))
    item = matrix.ITEMS[1]
    assert all(check.passed for check in item.present(data).checks)
    runs = data["rows"][0]["runs"]
    runs["direct"]["worst"], runs["low-rank"]["worst"] = 1e-6, None
    outcome = item.present(data)
    assert [check.passed for check in outcome.checks] == [True, False, False, True, True]
    assert [row[3] for row in outcome.tables[-1].rows] == ["no result", "1e-06"]

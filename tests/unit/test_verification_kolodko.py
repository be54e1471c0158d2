"""The verification against Kolodko and Sabelfeld (2003) itself: targets, laws, right from wrong."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from verification.kolodko_sabelfeld_2003 import SUITE, efficiency, tables2  # noqa: E402
from verification.kolodko_sabelfeld_2003.common import (  # noqa: E402
    ALGORITHMS,
    TARGETS,
    curves,
    exact,
    finite,
    target,
)


def test_targets_are_complete():
    names = {path.stem for path in TARGETS.glob("*.toml")}
    assert {f"table4_{k}" for k in range(1, 14)} | {"table2_1", "table2_2"} <= names
    for name in names:
        table = target(name)
        assert table["rows"], name
        assert len(table["units"]) == len(table["columns"]), name
    for k in range(3, 14):
        assert {row["algorithm"] for row in target(f"table4_{k}")["rows"]} <= set(ALGORITHMS)
    for name in ("figure5_1", "figure5_2"):
        data = curves(name)
        assert {"consistent", "beta", "A", "tau", "c_5"} <= set(data.dtype.names)
        assert len(data) > 100


def test_items_have_their_own_names():
    names = [item.name for item in SUITE.items]
    assert len(names) == len(set(names)) == 15


def test_covariances_of_the_finite_system():
    """Against all 22 partitions of eight monomers."""
    from smolux.exact.finite import law

    eight, t = law("constant", 8), 1.3
    states, p = eight.partition_pmf(t)
    counts = np.array([[state.count(size) for size in (1, 2, 4, 7, 8)] for state in states])
    number = np.array([len(state) for state in states])
    means = p @ counts
    products = p @ (counts * number[:, None]) - means * (p @ number)
    got = tables2._law(8, np.array([t]), np.array([1, 2, 4, 7, 8]))
    np.testing.assert_allclose(got[0][0], means / 8, rtol=1e-11)
    np.testing.assert_allclose(got[1][0], products / 64, rtol=1e-10, atol=1e-14)


def _measured(name: str, bias: float = 1.0, variance: float = 1.0) -> dict:
    """Make what `compute` returns, from the law of direct simulation and the paper's St."""
    rng = np.random.default_rng(6)
    table = target(name)
    times, observables = table["times"], [table["observable"]]
    u = exact(table["kernel"], observables, times)[0]
    found: dict = {"exact": u, "rows": {}}
    for row in table["rows"]:
        law = finite(table["kernel"], observables, times, row["N"])[0]
        direct = row["algorithm"] == "MMF"
        true = u + bias * (law - u) if direct else u
        statistical = table["reference"]["St"] if direct else row["St"]
        error = u * statistical / 300 * np.sqrt(variance)
        found["rows"][row["algorithm"]] = {
            "mean": true + error * rng.normal(size=len(times)),
            "error": error,
            "variance": error**2 * row["M"],
            "variance_error": np.full(len(times), 0.02),
            "cost": [1e-3, 1.1e-3, 1e-3],
            "replicas": row["M"],
            "method": "auto",
            "law": law,
        }
    return {name: found}


@pytest.mark.parametrize(
    ("bias", "variance", "wrong"), [(1.0, 1.0, ""), (-1.0, 1.0, "mean of MMF"), (1.0, 1.4, "St")]
)
def test_a_table_tells_right_from_wrong(bias, variance, wrong):
    checks = efficiency.present(("table4_8",), _measured("table4_8", bias, variance)).checks
    failed = [check.what for check in checks if not check.passed]
    assert bool(failed) == bool(wrong)
    assert all(wrong in what for what in failed)

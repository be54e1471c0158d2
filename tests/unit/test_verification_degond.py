"""The verification of discs in a box: its helpers, its targets, and that it can fail."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from verification.degond_2024 import (
    SUITE,
    controls,
    ensemble,
    figure11,
    final_time,
    large,
    run_time,
    short_steps,
)
from verification.degond_2024.common import (
    METHODS,
    TARGETS,
    against_known,
    difference,
    rayleigh,
    target,
)
from verification.suite import plain


def test_targets_are_complete():
    for path in TARGETS.glob("*.toml"):
        table = target(path.stem)
        assert table["rows"], path
        assert len(table["units"]) == len(table["columns"]), path
    assert target("dimensions")["rows"][1]["2500"] == 1.52


def test_items_have_their_own_names():
    names = [item.name for item in SUITE.items]
    assert len(names) == len(set(names)) == 15


def test_scores_follow_the_normal_law():
    rng = np.random.default_rng(1)
    two = [difference(rng.normal(1, 2, 8), rng.normal(1, 1, 5)) for _ in range(1000)]
    one = [against_known(rng.normal(1, 2, 8), rng.normal(1, 2, 6).mean(), 6, 0) for _ in two]
    assert stats.kstest(two, "norm").pvalue > 1e-3
    assert stats.kstest(one, "halfnorm").pvalue > 1e-3
    assert against_known(rng.normal(1, 2, 8), 5.0, 6, 4.0) < 2  # within the rounding
    ranks = [final_time.ranks(rng.normal(size=40), rng.normal(size=40)) for _ in two]
    assert np.std(ranks) == pytest.approx(1, abs=0.1)


def test_directions():
    angles = np.random.default_rng(2).uniform(0, np.pi, (2000, 50))
    found = np.array([rayleigh(a, 2) for a in angles])
    assert (found[:, 0] > found[:, 1]).mean() == pytest.approx(0.05, abs=0.02)
    assert rayleigh(np.full(20, 0.3), 2)[0] == pytest.approx(1)


def test_exponents_are_those_of_power_laws():
    times = {str(n): 3e-6 * n**1.2 for n in (10, 400, 1600, 10_000)} | {"20": 7.0}
    assert run_time.exponent(times, 400) == pytest.approx(1.2)
    left = np.unique(np.geomspace(100, 99_999, 300).astype(int))
    found = {"clusters": left, "time": (left / 1e5) ** (-1 / 1.3)}
    _, z = large.exponents(found, 100_000)
    np.testing.assert_allclose(z, 1.3, rtol=1e-3)


def test_the_limit_of_short_steps():
    rng = np.random.default_rng(3)
    of = {
        "rigid": {str(f): {"a": rng.normal(2 + 0.4 * f, 0.01, 400)} for f in (0.5, 0.3, 0.2, 0.1)}
    }
    limit, error = short_steps.limit_of(of, "rigid", "a")
    assert abs(limit - 2) < 4 * error < 0.02


def test_known_patterns():
    outcome = controls.present(plain(controls.compute(True)))
    assert all(check.passed for check in outcome.checks)


def _dimensions(shift: float) -> dict:
    """Make runs with the known dimensions, those of time stepping off by `shift`."""
    rng = np.random.default_rng(4)
    known = {row["phi"]: row for row in target("dimensions")["rows"]}
    sizes, fractions = (400, 2500), (0.1, 0.3)
    cells = {
        m: {
            f"{f:g}": {
                str(n): {"dimension": rng.normal(known[f][str(n)] + k * shift, 0.01, 20)}
                for n in sizes
            }
            for f in fractions
        }
        for k, m in enumerate(METHODS)
    }
    seeds = [20 for _ in sizes]
    return plain({"cells": cells, "sizes": sizes, "fractions": fractions, "seeds": seeds})


def test_an_item_tells_right_from_wrong():
    assert all(check.passed for check in figure11.present(_dimensions(0.0)).checks)
    wrong = [check.what for check in figure11.present(_dimensions(0.03)).checks if not check.passed]
    assert any("steps 0.2 R and event-driven" in what for what in wrong)
    assert any("as computed independently" in what for what in wrong)


def test_what_is_selected_can_be_stored():
    data = _dimensions(0.0)
    assert ensemble.values(data, METHODS[0], 0.1, 400, "dimension").shape == (20,)
    assert "20 of N = 2500" in ensemble.ran(data)

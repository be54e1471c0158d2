"""The conformance suite passes the program and fails wrong ones."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

import smolux
from smolux import conformance
from smolux.cli.app import app
from smolux.conformance import Check, Finding, Verdict
from smolux.methods import METHODS

METHOD = "acceptance-rejection"
CHECKS = {check.name: check for check in conformance.checks()}
#: those that share one compiled loop, which keeps this file fast
QUICK = (
    "mean, K = 1",
    "fluctuations, K = 1",
    "waiting time, N = 2",
)


def finding(name: str) -> Finding:
    (found,) = conformance.verify([METHOD], seed=3, only=[CHECKS[name]])
    return found


@pytest.fixture
def wrong(monkeypatch):
    """Make `simulate` spoil its results."""
    right = smolux.simulate

    def install(spoil):
        def simulate(*arguments, **settings):
            ds = right(*arguments, **settings)
            spoil(ds)
            return ds

        monkeypatch.setattr(smolux, "simulate", simulate)

    return install


@pytest.mark.parametrize("name", [*QUICK, "mass, to the monomer"])
def test_the_program_passes(name):
    found = finding(name)
    assert found.passed, found
    assert found.p <= 1
    assert found.seconds > 0


def test_a_mean_that_is_half_a_percent_off_fails(wrong):
    def spoil(ds):
        ds["number_density"] *= 1.005

    wrong(spoil)
    assert not finding("mean, K = 1").passed


@pytest.mark.parametrize("factor", [0.008, 0.85, 1.2])
def test_wrong_fluctuations_fail_though_the_mean_is_right(wrong, factor):
    # 0.3 in place of 37 is what adding mean waiting times gives
    def spoil(ds):
        number = ds["particles"].values
        ds["particles"].values[:] = number.mean() + factor * (number - number.mean())

    wrong(spoil)
    assert not finding("fluctuations, K = 1").passed


def test_mean_waiting_times_in_place_of_exponential_ones_fail(wrong):
    def spoil(ds):
        ds["extinction_time"].values[:] = 2.0

    wrong(spoil)
    assert not finding("waiting time, N = 2").passed


def test_waiting_times_a_tenth_too_long_fail(wrong):
    def spoil(ds):
        ds["extinction_time"].values[:] *= 1.1

    wrong(spoil)
    assert not finding("waiting time, N = 2").passed


def test_one_monomer_lost_fails(wrong):
    def spoil(ds):
        ds["sample_count"].values[0] -= 1

    wrong(spoil)
    found = finding("mass, to the monomer")
    assert not found.passed
    assert found.measured == "1 of 12 wrong"


def test_partitions_that_follow_another_kernel_fail(wrong):
    """Counts of a kernel are not those of one that is slower by a quarter."""
    check = conformance.Check("x", conformance.partitions(smolux.kernels.Constant(), 0.0))
    right = smolux.simulate

    def slower(model, *arguments, **settings):
        return right(smolux.Model(smolux.kernels.Constant(0.8)), *arguments, **settings)

    smolux.simulate, before = slower, smolux.simulate
    try:
        assert not next(conformance.verify([METHOD], only=[check])).passed
    finally:
        smolux.simulate = before


# --- the statistics ----------------------------------------------------------------------------


def test_the_probabilities_are_uniform_if_all_is_right():
    generator = np.random.default_rng(5)
    pmf = np.array([0.5, 0.3, 0.15, 0.04, 0.009, 0.001])
    chi, var = [], []
    for _ in range(400):
        counts = generator.multinomial(2000, pmf).astype(float)
        chi.append(conformance.chi_square(counts, 2000 * pmf)[2])
        var.append(conformance.variance_p(generator.normal(0, 3, 200), 9.0))
    for sample in (chi, var):
        edges = np.histogram(sample, bins=4, range=(0, 1))[0]
        assert abs(edges - 100).max() < 40


def test_rare_counts_are_put_together():
    expected = np.array([1000.0, 3.0, 1.0, 0.5, 0.1])
    value, dof, _ = conformance.chi_square(expected, expected)
    assert value == 0
    assert dof == 0 or dof == 1
    _, dof, p = conformance.chi_square(np.array([980.0, 20.0, 4.6]), np.array([995.0, 5.0, 4.6]))
    assert dof == 1
    assert p < 1e-4


# --- the command -------------------------------------------------------------------------------


def test_verify_prints_a_table_and_fails_if_a_check_does(monkeypatch):
    def checks():
        return (
            Check("good", lambda method, seed: Verdict("1", "1", 0.5)),
            Check("bad", lambda method, seed: Verdict("1", "2", float(method == "inverse"))),
        )

    monkeypatch.setattr(conformance, "checks", checks)
    result = CliRunner().invoke(app, ["verify", "--seed", "4"])
    assert result.exit_code == 1
    rows = result.stdout.splitlines()
    known = len(METHODS)
    assert sum("passed" in row for row in rows) == known + 1
    assert sum("FAILED" in row for row in rows[:-1]) == known - 1
    assert f"{known - 1} of {2 * known} checks FAILED" in rows[-1]
    assert max(map(len, rows)) <= 80
    result = CliRunner().invoke(app, ["verify", "-m", "inverse"])
    assert result.exit_code == 0
    assert "All 2 checks passed" in result.stdout
    result = CliRunner().invoke(app, ["verify", "-m", "invers"])
    assert result.exit_code == 2
    assert "did you mean 'inverse'" in result.stderr

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import smolux
from shared import KERNEL
from smolux.case import parse
from smolux.cli import cautions, estimate
from smolux.cli.commands import check
from smolux.errors import InputError
from smolux.runtime import executors
from smolux.stochastic import plan


def case(kernel: str, run: str = "times = [2]", rest: str = ""):
    run += '\nseed = 1\nmethod = "acceptance-rejection"\n'
    return parse(f"[kernel]\n{kernel}\n{rest}\n[run]\n{run}")


# --- gelation ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("density", "scale", "end", "time"),
    [(1, 1, 2, 1.0), (4, 1, 2, 0.25), (1, 0.5, 3, 2.0), (0.1, 1, 2, None), (1, 1, 0.9, None)],
)
def test_the_gel_time_is_scaled_by_density_and_prefactor(density, scale, end, time):
    found = cautions.physics_warnings(
        case(
            f'name = "multiplicative"\nscale = {scale}', f"times = [{end}]",
            f"[initial]\ndensity = {density}",
        )
    )  # fmt: skip
    if time is None:
        assert found == []
    else:
        (warning,) = found
        assert warning.startswith(f"gelation at t = {time:.4g}, before the end at {end}")


def test_other_starts_and_unknown_kernels():
    (warning,) = cautions.physics_warnings(
        case('name = "multiplicative"', rest='[initial]\nname = "exponential"\nmean = 5')
    )
    assert "monomers of the same mass at t = 0.2, this initial condition sooner" in warning
    (warning,) = cautions.physics_warnings(case('formula = "i*j"\ndegree = 2'))
    assert "may gel" in warning
    (warning,) = cautions.physics_warnings(case('formula = "i*j"\ngels = true'))
    assert "at a time that is not known" in warning
    (warning,) = cautions.physics_warnings(
        case('name = "multiplicative"', rest='[[processes]]\nname = "aggregation"\nvarying = "t"')
    )
    assert "at a time that is not known" in warning
    assert cautions.physics_warnings(case('name = "constant"')) == []


def test_what_breaks_clusters_up_may_prevent_a_gel():
    text = '[[processes]]\nname = "aggregation"\n[[processes]]\nname = "shattering"\nrate = 0.1\n'
    assert cautions.physics_warnings(case('name = "multiplicative"', rest=text)) == []


# --- mistakes that only the whole case shows -----------------------------------------------------


def test_rates_that_fall_below_zero_are_found_before_the_run():
    text = (
        '[[processes]]\nname = "aggregation"\n[[processes]]\nname = "shattering"\n'
        'rate = "0.01*(1 - t/400)"\n'
    )
    fine = case('name = "constant"', "times = [399]", text)
    assert cautions.negative_rates(fine) == []
    with pytest.raises(InputError, match=r"at t = 400\.\d+; it must be"):
        check.text(case('name = "constant"', "times = [500]", text), "case.toml")


# --- cost ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("population", ["doubling", "fixed-volume"])
def test_the_number_of_collisions_is_about_right(population):
    rest = '[[processes]]\nname = "aggregation"\n[[processes]]\nname = "shattering"\nrate = 0.1\n'
    given = case(
        KERNEL.partition("\n")[2],
        f'times = [30]\nparticles = 40000\nreplicas = 2\npopulation = "{population}"',
        rest,
    )
    cost = estimate.estimate(given)
    ds = smolux.simulate(
        given.model, [30], particles=40_000, replicas=2, seed=5, population=population,
        method="acceptance-rejection",
    )  # fmt: skip
    assert cost.collisions == pytest.approx(float(ds.attrs["events"]), rel=0.1)
    assert 0 < cost.seconds < 60
    assert cost.output > ds.nbytes * 0.5
    assert cost.output < 3 * ds.nbytes
    assert cost.memory > 8 * 2 * 40_000


def test_extinction_is_foreseen():
    run = 'times = [5000]\nparticles = 1000\npopulation = "fixed-volume"'
    (warning,) = estimate.estimate(case('name = "constant"', run)).warnings
    assert "everything becomes one cluster (extinction)" in warning
    run = run.replace("5000", "50")
    (warning,) = estimate.estimate(case('name = "constant"', run)).warnings
    assert "about 38" in warning or "replicas may end as one cluster" in warning
    assert estimate.estimate(case('name = "constant"', run.replace("1000", "1e5"))).warnings == []
    assert (
        estimate.estimate(
            case('name = "constant"', run.replace("fixed-volume", "doubling"))
        ).warnings
        == []
    )


def test_one_replica_and_rare_sizes_are_told():
    rest = '[initial]\nname = "sizes"\ndensities = { 1 = 1.0, 50 = 1e-4 }\n'
    given = case('name = "constant"', "times = [1]\nparticles = 1000\nreplicas = 1", rest)
    found = cautions.all_warnings(given, given.run)
    assert len(found) == 2
    assert "of size 50 there are fewer than 10" in found[0]
    assert "one replica gives no error bars" in found[1]


def test_a_pilot_that_does_not_reach_the_end_says_so(monkeypatch):
    monkeypatch.setattr(estimate, "_LIMIT", 0.0)
    small = estimate.pilot(case('name = "constant"', "times = [1e9]\nparticles = 1e6"))
    if small.reached < 1:
        assert "extrapolated" in estimate._pilot_warnings(small)[0]
    assert np.isfinite(small.expected_collisions(case('name = "constant"').run))


def test_what_can_happen_bounds_the_estimate():
    """In a fixed volume N particles that merge do so N - 1 times, whatever the end."""
    run = 'times = [1e8]\nparticles = 1000\npopulation = "{}"\nreplicas = 2'
    for population in ("fixed-volume", "none"):
        cost = estimate.estimate(case('name = "constant"', run.format(population)))
        assert cost.collisions == pytest.approx(2 * 999, rel=0.05)
        assert cost.collisions <= 2 * 999
        assert "only about 1 of 1000" in cost.warnings[0]


def test_no_method_takes_more_than_is_said_before_one_is_loaded():
    """By which a run is let pass without a plan."""
    for particles in (1, 100, 3000, 10**5, 10**7, 10**9):
        run = replace(case('name = "constant"').run, particles=particles, replicas=3)
        for method in smolux.methods.METHODS:
            assert cautions.stores(replace(run, method=method.name), particles) <= (
                cautions.stores_at_most(run)
            )


def small_pilot(times, collisions, volume, end, merging=True):
    ones = np.ones(len(times))
    return estimate.Pilot(
        1000, np.array(times), 1 / np.array(volume), np.array(collisions), 1000 * np.array(volume),
        ones, 1e-7, end, merging,
    )  # fmt: skip


def test_a_short_pilot_is_gone_on_with_as_it_grew():
    """Not in proportion to time: doublings, of 500 events each, come ever more slowly."""
    times = [0.0, 1.0, 10.0, 100.0, 1000.0]
    late = small_pilot(times, [0, 500, 1000, 1500, 2000], [1.0, 2, 4, 8, 16], 1e8)
    doubling = case('name = "constant"', "times = [1e8]\nparticles = 1000").run
    assert 4500 <= late.expected_collisions(doubling) < 10_000
    steady = small_pilot(times, [0, 1, 10, 100, 1000], [1.0] * 5, 1e8, merging=False)
    assert steady.expected_collisions(doubling) == pytest.approx(1e8)
    more = replace(doubling, particles=7000)
    assert steady.expected_collisions(more) == pytest.approx(7e8)
    fixed = case(
        'name = "constant"', 'times = [1e8]\nparticles = 1000\npopulation = "fixed-volume"'
    ).run
    assert late.expected_collisions(fixed) <= 999
    assert steady.expected_collisions(fixed) == pytest.approx(1e8)


def test_what_a_run_refuses_the_check_refuses(monkeypatch):
    monkeypatch.setattr(plan, "available_memory", lambda: 1e9)
    many = case('name = "constant"', "times = [1]\nparticles = 1e9")
    with pytest.raises(InputError, match=r"case\.toml: the run needs about .* GB") as caught:
        check.text(many, "case.toml")
    with pytest.raises(InputError) as refused:
        smolux.simulate(many.model, **many.run.arguments())
    assert caught.value.problems == [f"case.toml: {p}" for p in refused.value.problems]
    rest = '[solve]\ntimes = [1]\ngel = "reacts"\n[[processes]]\nname = "shattering"\nrate = 1\n'
    solved = parse(f'[kernel]\nname = "constant"\n{rest}')
    with pytest.raises(InputError, match="for aggregation alone"):
        check.text(solved, "case.toml")
    monkeypatch.setattr(executors, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="needs distributed, which is not installed"):
        check.text(case('name = "constant"', rest='[parallel]\nexecutor = "dask"'), "case.toml")

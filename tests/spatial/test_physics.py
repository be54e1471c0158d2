"""Conservation laws, contacts, replay; input that is degenerate."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from flights import METHODS, merges, run

import smolux.spatial as sp
from smolux import results
from smolux.errors import SmoluxWarning


@pytest.fixture(scope="module")
def periodic() -> xr.DataTree:
    radii = sp.lognormal_radii(1.3)
    s = sp.random(400, 0.2, walls="periodic", radii=radii, velocities="maxwellian", seed=11)
    return sp.simulate(s, times=[0.0, 0.5, 2.0, 20.0])


@pytest.fixture(scope="module")
def lattice() -> xr.DataTree:
    return sp.simulate(sp.lattice(400, 0.3, seed=12))


def test_momentum_is_conserved_between_periodic_walls(periodic):
    mass, v = periodic["mass"].values, periodic["velocity"].values
    start = mass @ periodic["initial_velocity"].values
    scale = np.abs(mass[:, None] * periodic["initial_velocity"].values).sum()
    np.testing.assert_allclose(mass @ v, start, rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(
        periodic["series/momentum"].values, np.tile(start, (4, 1)), rtol=0, atol=1e-12 * scale
    )


@pytest.mark.parametrize("which", ["periodic", "lattice"])
def test_all_links_are_contacts_and_nothing_overlaps(which, request):
    result = request.getfixturevalue(which)
    s = sp.system_of(result)
    x, r = result["position"].values, result["radius"].values
    i, j = np.triu_indices(len(x), 1)
    gap = np.linalg.norm(s.box.nearest(x[j] - x[i]), axis=1) - r[i] - r[j]
    events = result["events"].to_dataset()
    linked = events["first"].values, events["second"].values
    assert len(linked[0]) == len(x) - 1
    links = np.linalg.norm(x[linked[1]] - x[linked[0]], axis=1) - r[linked[0]] - r[linked[1]]
    if which == "lattice":
        assert np.abs(links).max() < 1e-10 * 2 * r.min()
    assert np.abs(events["gap"].values).max() < 1e-10 * 2 * r.min()
    assert gap.min() > -1e-10 * 2 * r.min()
    # the links are contacts of discs as they are at the end, and there are hardly more
    assert (np.abs(gap) < 1e-10).sum() == len(x) - 1


def test_a_whole_cluster_is_unwrapped(periodic):
    """Links are contacts without the nearest image, but for those that closed a loop: none."""
    x, r = periodic["position"].values, periodic["radius"].values
    events = periodic["events"].to_dataset()
    i, j = events["first"].values, events["second"].values
    np.testing.assert_allclose(np.linalg.norm(x[j] - x[i], axis=1), r[i] + r[j], rtol=1e-10)


def test_energy_that_a_merge_loses(periodic):
    events = periodic["events"].to_dataset()
    m = events["masses"].values
    loss = 0.5 * m.prod(1) / m.sum(1) * events["relative_speed"].values ** 2
    np.testing.assert_allclose(events["energy_loss"].values, loss, rtol=1e-13)
    series = periodic["series"].to_dataset()
    for time, energy in zip(series["time"].values, series["kinetic_energy"].values, strict=True):
        lost = events["energy_loss"].values[events["time"].values <= time].sum()
        assert energy == pytest.approx(sp.system_of(periodic).kinetic_energy - lost, rel=1e-11)


def test_where_and_how_two_discs_meet(periodic):
    """Just before: both are their radius away from the point, and fly past at a known distance."""
    events, s = periodic["events"].to_dataset(), sp.system_of(periodic)
    for k in range(0, 399, 57):
        now = sp.replay(periodic, float(events["time"][k]) * (1 - 1e-12))
        x, v = now["position"].values, now["velocity"].values
        both = [int(events[side][k]) for side in ("first", "second")]
        away = s.box.nearest(events["point"].values[k] - x[both])
        np.testing.assert_allclose(np.linalg.norm(away, axis=1), s.radius[both], rtol=1e-7)
        d, w = away[0] - away[1], v[both[1]] - v[both[0]]
        speed = np.linalg.norm(w)
        assert float(events["relative_speed"][k]) == pytest.approx(speed)
        impact = abs(d[0] * w[1] - d[1] * w[0]) / speed
        assert float(events["impact_parameter"][k]) == pytest.approx(impact, rel=1e-6, abs=1e-9)


def test_the_merger_tree_is_a_tree(lattice):
    events = lattice["events"].to_dataset()
    n = lattice.sizes["disc"]
    parents, child = events["parents"].values, events["child"].values
    assert sorted(parents.ravel()) == list(range(2 * n - 2))
    assert (parents < child[:, None]).all()
    size = np.ones(2 * n - 1)
    for m, (a, b) in enumerate(parents):
        assert list(events["sizes"].values[m]) == [size[a], size[b]]
        size[n + m] = size[a] + size[b]
    assert (np.diff(events["time"].values) >= 0).all()
    assert (events["impact_parameter"].values <= 2 * lattice["radius"].values[0] * (1 + 1e-9)).all()


def test_the_first_contact_of_each_disc(lattice):
    events = lattice["events"].to_dataset()
    first = np.full(lattice.sizes["disc"], np.inf)
    for side in ("first", "second"):
        np.minimum.at(first, events[side].values, events["time"].values)
    np.testing.assert_array_equal(lattice["first_contact"], first)


def test_replay_gives_any_instant(lattice, periodic):
    for result in (lattice, periodic):
        end = sp.replay(result, result.attrs["time_reached"])
        np.testing.assert_allclose(end["position"], result["position"], rtol=0, atol=1e-9)
        np.testing.assert_array_equal(end["cluster"], result["cluster"])
        start = sp.replay(result, 0.0)
        np.testing.assert_array_equal(start["position"], result["initial_position"])
    s = sp.system_of(lattice)
    for time in (0.7, 3.0):
        there = run(s, "windowed", until=time)
        again = sp.replay(lattice, time)
        np.testing.assert_allclose(again["position"], there.position, rtol=0, atol=1e-10)
        np.testing.assert_allclose(again["velocity"], there.velocity, rtol=1e-10)
        np.testing.assert_array_equal(again["cluster"], there.cluster)


def test_series_from_the_clusters_of_each_time(periodic):
    series = periodic["series"].to_dataset()
    for k, time in enumerate(series["time"].values):
        cluster = sp.replay(periodic, float(time))["cluster"].values
        _, sizes = np.unique(cluster, return_counts=True)
        assert series["clusters"].values[k] == len(sizes)
        assert series["largest"].values[k] == sizes.max()
        np.testing.assert_allclose(series["moment"].values[k], [(sizes**p).sum() for p in range(4)])
        assert series["n_bin"].values[k].sum() == len(sizes)
        assert series["mean_mass"].values[k] == pytest.approx(400 / len(sizes))
        heaviest = np.bincount(cluster, periodic["mass"].values).max()
        assert series["largest_mass"].values[k] == pytest.approx(heaviest)


def test_files_keep_everything(lattice, tmp_path):
    back = results.load(results.save(lattice, tmp_path / "run.nc"))
    for group in ("/", "series", "events", "walls"):
        xr.testing.assert_identical(back[group].to_dataset(), lattice[group].to_dataset())
    assert back["events"]["time"].dims == ("event",)
    np.testing.assert_array_equal(
        sp.replay(back, 2.0)["position"], sp.replay(lattice, 2.0)["position"]
    )


def pair(v, x=((1.0, 2.0), (3.0, 2.0)), **settings) -> sp.System:
    return sp.System(position=x, velocity=v, radius=0.5, box=4, **settings)


@pytest.mark.parametrize(
    "method", [pytest.param(m, marks=[pytest.mark.slow] * (m == "windowed")) for m in METHODS]
)
def test_one_disc(method):
    """Slow for `windowed`, of which a table of one row is another type to the compiler."""
    s = sp.System(position=[[1, 1]], velocity=[[1, 0]], radius=0.5, box=4)
    trace = run(s, method, until=5.0)
    assert trace.stopped == ""
    assert trace.time == 0  # it is one cluster already


@pytest.mark.parametrize("method", METHODS)
class TestDegenerate:
    def test_nothing_moves(self, method):
        trace = run(pair([[0, 0], [0, 0]]), method)
        assert trace.time == 0
        assert "nothing moves" in trace.stopped

    def test_all_move_alike_in_a_periodic_box(self, method):
        trace = run(pair([[1, 2], [1, 2]], walls="periodic"), method)
        assert "nothing moves" in trace.stopped

    def test_two_that_never_meet(self, method):
        x = ((1.0, 1.0), (1.0, 3.0))
        settings = METHODS[method](patience=20.0)
        trace = run(pair([[1, 0], [-1, 0]], x, walls="periodic"), settings)
        assert "never meet" in trace.stopped
        assert not len(trace.log.time)

    def test_grazing_discs_miss_and_those_a_little_nearer_meet(self, method):
        for shift, met in ((0.0, 1), (1e-9, 0)):
            x = ((1.0, 1.0), (3.0, 2.0 - 1e-12 + shift))
            s = pair([[1, 0], [0, 0]], x, walls=("periodic", "reflecting"))
            assert len(merges(run(s, method, until=4.0))) == met

    def test_contact_at_the_start(self, method):
        x = ((1.0, 2.0), (2.0, 2.0))
        approaching = run(pair([[1, 0], [0, 0]], x), method)
        assert list(approaching.log.time) == [0.0]
        parting = run(pair([[-1, 0], [0, 0]], x), method)
        assert len(parting.log.time) > 1

    def test_simultaneous_contacts_by_number(self, method):
        x = [[1, 1], [3, 1], [1, 3], [3, 3], [1, 5], [3, 5]]
        v = [[0.5, 0], [-0.5, 0]] * 3
        s = sp.System(position=x, velocity=v, radius=0.5, box=8)
        trace = run(s, method, clusters=3)
        np.testing.assert_array_equal(merges(trace), [[0, 1], [2, 3], [4, 5]])
        assert (trace.log.time == 1.0).all()

    def test_three_in_a_row_at_once(self, method):
        x, v = [[1, 1], [3, 1], [5, 1]], [[1, 0], [0, 0], [-1, 0]]
        s = sp.System(position=x, velocity=v, radius=0.5, box=8)
        trace = run(s, method)
        np.testing.assert_array_equal(merges(trace), [[0, 1], [1, 2]])
        np.testing.assert_allclose(trace.velocity, 0, atol=1e-15)

    def test_a_corner_turns_both_components(self, method):
        s = pair([[1, 1], [0, 0]], ((1.5, 1.5), (3.5, 0.5)))
        trace = run(s, method, until=3.0)
        assert list(trace.log.second) == [-1, -2]
        np.testing.assert_allclose(trace.position[0], [2.5, 2.5])

    def test_a_cluster_between_two_walls_comes_to_rest(self, method):
        s = sp.System(
            position=[[0.5, 1], [1.5, 1], [1, 3]],
            velocity=[[1, 0.25], [-1, 0.25], [0.5, 0]],
            radius=0.5,
            box=(2, 8),
        )
        trace = run(s, method, until=3.0, clusters=1)
        assert trace.log.time[0] == 0
        assert list(trace.log.second[:1]) == [1]
        # it fills the box: once something has set it in motion across, it stops at the wall
        assert (trace.position[:, 0] > 0.5 - 1e-9).all()
        assert (trace.position[:, 0] < 1.5 + 1e-9).all()


def test_a_filled_axis_is_logged_and_replayed():
    s = sp.System(
        position=[[0.5, 1], [1.5, 1], [1, 3]],
        velocity=[[0.5, 0], [-0.25, 0], [0, 0]],
        radius=0.5,
        box=(2, 8),
    )
    traces = [run(s, method, until=3.0) for method in METHODS]
    for trace in traces:
        np.testing.assert_array_equal(trace.log.second, [1, -3])
        np.testing.assert_array_equal(trace.velocity, 0)
    with pytest.warns(SmoluxWarning, match="nothing moves relative to anything else"):
        result = sp.simulate(s, until=3.0)
    assert result["walls"]["at_rest"].values.tolist() == [1]
    np.testing.assert_allclose(sp.replay(result, 1.0)["position"], s.position, atol=1e-15)

"""Systems: what is refused, and initial conditions."""

from __future__ import annotations

import numpy as np
import pytest

import smolux as sx
import smolux.spatial as sp
from smolux.runtime import resources, room
from smolux.spatial import simulation
from smolux.spatial.methods import time_stepping, windowed

FINE = {"position": [[1, 1], [3, 1]], "velocity": [[1, 0], [0, 1]], "radius": 0.5, "box": 4}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position": [1, 1]}, "position: has the shape (2,)"),
        ({"position": "here"}, "position: must be an array of numbers"),
        ({"position": [[1, np.nan], [3, 1]]}, "position: not finite for disc 0"),
        ({"velocity": [[1, 0]]}, "velocity: has the shape (1, 2)"),
        ({"velocity": [[1, 0], [np.inf, 0]]}, "velocity: not finite for disc 1"),
        ({"radius": [0.5, 0.0]}, "radius = 0.0 for disc 1"),
        ({"radius": [0.5, 0.5, 0.5]}, "radius: must be a number or one for each of the 2 discs"),
        ({"mass": [1, -1]}, "mass = -1.0 for disc 1"),
        ({"box": -1}, "side 0 = -1.0"),
        ({"box": (4, 4, 4)}, "has 3 axes, the positions 2"),
        ({"walls": "sticky"}, "walls = 'sticky': unknown"),
        ({"walls": ["periodic"]}, "names 1 axes, the box has 2"),
        ({"wall_contact": "edge"}, "wall_contact = 'edge'"),
        ({"position": [[1, 1], [3.8, 1]]}, "disc 1 beyond a wall of axis 0"),
        ({"position": [[1, 1], [1.9, 1]]}, "discs overlap: 0 and 1; the first two by 0.1"),
        ({"walls": "periodic", "radius": 1.0}, "must be longer than two diameters"),
        ({"walls": "periodic", "position": [[0.1, 1], [3.9, 1]]}, "overlap: 0 and 1"),
    ],
)
def test_mistakes_are_named(change, words):
    with pytest.raises(sx.InputError) as caught:
        sp.System(**FINE | change)
    assert words in str(caught.value)


def test_all_mistakes_at_once():
    with pytest.raises(sx.InputError) as caught:
        sp.System(position=[[1, 1]], velocity=[[np.nan, 0]], radius=-1, mass=0, box=0)
    assert len(caught.value.problems) == 5


def test_discs_in_contact_and_at_walls_are_fine():
    sp.System(**FINE | {"position": [[0.5, 0.5], [1.5, 0.5]]})
    sp.System(**FINE | {"position": [[0, 0], [1, 0]], "wall_contact": "centre"})


def test_a_system_is_frozen():
    s = sp.System(**FINE)
    with pytest.raises(ValueError, match="read-only"):
        s.position[0, 0] = 2
    with pytest.raises(AttributeError):
        s.box = 3
    given = np.array(FINE["position"], float)
    s = sp.System(**FINE | {"position": given})
    given[0] = 9
    assert s.position[0, 0] == 1


def test_masses_by_size():
    s = sp.System(**FINE | {"radius": [0.25, 0.5]})
    np.testing.assert_allclose(s.mass, [0.4, 1.6])
    s = sp.System([[1, 1, 1], [3, 1, 1]], np.zeros((2, 3)), [0.25, 0.5], box=4)
    np.testing.assert_allclose(s.mass, [2 / 9, 16 / 9])


def test_the_lattice_of_the_paper():
    s = sp.lattice(400, 0.3, seed=1)
    assert s.box.lengths == (20.0, 20.0)
    assert s.volume_fraction == pytest.approx(0.3)
    assert s.radius[0] == pytest.approx(0.3090, abs=5e-5)
    np.testing.assert_allclose(np.linalg.norm(s.velocity, axis=1), 1)
    # directions are uniform: sum of 400 unit vectors, each component of variance 200
    assert np.abs(s.velocity.sum(0)).max() < 4 * np.sqrt(200)
    assert np.array_equal(sp.lattice(400, 0.3, seed=1).velocity, s.velocity)
    assert not np.array_equal(sp.lattice(400, 0.3, seed=2).velocity, s.velocity)


@pytest.mark.parametrize("dimension", [2, 3])
def test_random_positions(dimension):
    s = sp.random(2000, 0.25, dimension=dimension, velocities="maxwellian", temperature=2.0, seed=4)
    assert s.volume_fraction == pytest.approx(0.25)
    # components of variance 2, to 4 sigma of the sample variance
    assert s.velocity.var() == pytest.approx(2, abs=4 * 2 * np.sqrt(2 / (2000 * dimension)))
    # means of uniform coordinates, to 4 sigma at most
    side = s.box.lengths[0]
    assert np.abs(s.position.mean(0) / side - 0.5).max() < 4 * np.sqrt(1 / 12 / 2000)


def test_radii_of_a_law():
    s = sp.random(500, 0.2, radii=sp.bimodal_radii(3.0, 0.1), seed=1, walls="periodic")
    assert s.volume_fraction == pytest.approx(0.2)
    small, large = np.unique(s.radius)
    assert large == pytest.approx(3 * small)
    assert (s.radius == large).sum() == 50
    assert s.mass.mean() == pytest.approx(1)
    drawn = sp.lognormal_radii(1.5)(np.random.default_rng(0), 10_000)
    assert np.log(drawn).std() == pytest.approx(np.log(1.5), abs=4 * np.log(1.5) / np.sqrt(20_000))


@pytest.mark.parametrize("dimension", [2, 3])
def test_discs_of_two_sizes_are_of_one_density_and_temperature(dimension):
    s = sp.random(
        2000, 0.1, dimension=dimension, radii=sp.bimodal_radii(3.0, 0.5), velocities="maxwellian",
        temperature=2.0, seed=4,
    )  # fmt: skip
    assert s.volume_fraction == pytest.approx(0.1)
    small, large = np.unique(s.radius)
    assert large == pytest.approx(3 * small)
    mass = [s.mass[s.radius == r] for r in (small, large)]
    assert mass[1][0] == pytest.approx(3**dimension * mass[0][0])
    for m, r in zip(mass, (small, large), strict=True):
        # to 4 sigma of the sample variance
        found = np.mean(m[:, None] * s.velocity[s.radius == r] ** 2)
        assert found == pytest.approx(2, abs=4 * 2 * np.sqrt(2 / (1000 * dimension)))


def test_nearest_images_along_axes_of_different_sides():
    box = sp.Box((10, 4, 3), walls=("periodic", "periodic", "reflecting"))
    np.testing.assert_allclose(box.nearest([[36.0, -9.5, 2.9]]), [[-4.0, -1.5, 2.9]])
    np.testing.assert_allclose(box.wrap([[36.0, -9.5, 2.9]]), [[6.0, 2.5, 2.9]])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: sp.lattice(10), "a lattice takes a square number of them, as 9 or 16"),
        (lambda: sp.lattice(9, 0.8), "discs touch at 0.7854"),
        (lambda: sp.lattice(9, dimension=4), "dimension = 4"),
        (lambda: sp.lattice(9, -1, velocities="fast"), "velocities = 'fast': unknown"),
        (lambda: sp.random(0), "discs = 0"),
        (lambda: sp.random(9, radii=[1, 2]), "radii: must be 9 positive numbers"),
        (lambda: sp.random(100, 0.7, seed=1), "discs fit, no room was found"),
        (lambda: sp.lognormal_radii(0.5), "sigma = 0.5"),
        (lambda: sp.bimodal_radii(-1, 2), "ratio = -1"),
    ],
)
def test_mistakes_in_initial_conditions(make, words):
    with pytest.raises(sx.InputError) as caught:
        make()
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"method": "windwoed"}, "did you mean 'windowed'"),
        ({"method": 3}, "method = 3: must be a name"),
        ({"until": 0}, "until = 0: must be a positive number"),
        ({"clusters": 0.5}, "clusters = 0.5: must be a whole number"),
        ({"times": [2, 1]}, "must ascend"),
        ({"times": [np.nan]}, "must be finite numbers"),
        ({"progress": 1}, "progress = 1: must be a function"),
    ],
)
def test_mistakes_in_simulate(arguments, words):
    with pytest.raises(sx.InputError) as caught:
        sp.simulate(sp.System(**FINE), **arguments)
    assert words in str(caught.value)


def test_what_is_no_system_or_result():
    with pytest.raises(sx.InputError, match=r"must be a smolux.spatial.System"):
        sp.simulate("discs")
    with pytest.raises(sx.InputError, match=r"what smolux.spatial.simulate returned"):
        sp.replay("result", 1.0)


def test_limits_and_progress():
    s, told = sp.lattice(100, 0.2, seed=3), []
    with pytest.warns(sx.SmoluxWarning, match="limit of 20 events") as warned:
        result = sp.simulate(s, max_events=20, progress=told.append)
    assert [str(w.message) for w in warned] == sx.results.warnings(result)
    assert [w.filename for w in warned] == [__file__]
    assert result["events"].sizes["event"] + result["walls"].sizes["reflection"] == 20
    assert "limit of 20 events" in result.attrs["stopped"]
    assert not result.attrs["complete"]
    assert told[-1].clusters == result["series"]["clusters"].values[-1]
    half = sp.simulate(s, until=1.0, times=[0.5, 1.0, 2.0])
    assert half.attrs["time_reached"] == 1.0
    assert half.attrs["complete"]
    assert np.isnan(half["series"]["clusters"].values).tolist() == [False, False, True]
    with pytest.raises(sx.InputError, match="must lie between 0 and 1"):
        sp.replay(half, 2.0)
    few = sp.simulate(s, clusters=40)
    assert few["events"].sizes["event"] == 60
    assert len(np.unique(few["cluster"])) == 40


def test_interruption_keeps_what_was_reached():
    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(sx.Interrupted) as caught:
        sp.simulate(sp.lattice(100, 0.2, seed=3), progress=stop)
    assert caught.value.dataset.attrs["stopped"] == "interrupted"


@pytest.mark.parametrize("why", ["the time limit of 1e-09 s", "memory: "])
def test_the_clock_and_the_memory_stop_a_run(why, monkeypatch):
    s, given = sp.lattice(100, 0.2, seed=3), {}
    if why == "memory: ":
        monkeypatch.setattr(room, "_SMALL", 0)
        monkeypatch.setattr(resources, "free_memory", lambda: 0.0)
    else:
        given["time_limit"] = 1e-9
    monkeypatch.setattr(simulation, "_BUDGET", 20)
    with pytest.warns(sx.SmoluxWarning, match=why):
        cut = sp.simulate(s, **given)
    monkeypatch.undo()
    assert cut.attrs["stopped"].startswith(why)
    assert not cut.attrs["complete"]
    assert 1 <= cut["events"].sizes["event"] <= 20
    whole, done = sp.simulate(s), sp.resume(cut)
    np.testing.assert_array_equal(done["events"]["first"], whole["events"]["first"])


@pytest.mark.parametrize("full", ["_PAIRS", "_EVENTS", "time-stepping"])
def test_lists_that_would_outgrow_the_memory_stop_a_run(full, monkeypatch):
    """Only lists of discs are asked for here: they begin too short."""
    s, given = sp.lattice(2025, 0.2, seed=3), {}
    if full == "time-stepping":
        monkeypatch.setattr(time_stepping, "_PAIRS", 0)
        given = {"method": sp.TimeStepping(step=0.5), "times": [1.0], "until": 1.0}
    else:
        monkeypatch.setattr(windowed, full, 0)
        monkeypatch.setattr(windowed, "_THIN", 2.0)
    monkeypatch.setattr(room, "_SMALL", 1)
    monkeypatch.setattr(simulation, "_EVENT", 0)
    monkeypatch.setattr(resources, "free_memory", lambda: 0.0)
    with pytest.warns(sx.SmoluxWarning, match="memory: lists of discs that may meet need "):
        cut = sp.simulate(s, **given)
    assert not cut.attrs["complete"]
    monkeypatch.setattr(resources, "free_memory", lambda: None)
    assert sp.simulate(s, **given).attrs["complete"]

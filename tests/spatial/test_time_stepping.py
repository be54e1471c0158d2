"""Time stepping: nothing overlaps, clusters hold together, short steps tend to the exact motion."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from flights import system
from scipy.spatial import cKDTree

import smolux.spatial as sp
from shared import stopped
from smolux import InputError, SmoluxWarning
from smolux.spatial import TimeStepping
from smolux.spatial.events.stepping import advance

# a step that fails is taken again; whether one does may depend on the last bit
pytestmark = pytest.mark.filterwarnings(
    r"default:\d+ steps failed and were taken again:smolux.errors.SmoluxWarning"
)


def worst_overlap(result: xr.DataTree) -> float:
    """Return the largest overlap of any two discs over the sum of radii, and check all numbers."""
    s = sp.snapshot(result)
    assert np.isfinite(s.position).all()
    assert np.isfinite(result["velocity"].values).all()
    tree = cKDTree(s.box.wrap(s.position), boxsize=s.box.periods)
    i, j = tree.query_pairs(2 * s.radius.max(), output_type="ndarray").T
    r = np.linalg.norm(s.box.nearest(s.position[j] - s.position[i]), axis=1)
    return float(np.max(1 - r / (s.radius[i] + s.radius[j]), initial=0.0))


def assert_sound(result: xr.DataTree, discs: int) -> None:
    """Check what holds for every run that came to one cluster."""
    assert result.attrs["stopped"] == ""
    assert worst_overlap(result) < 1.1e-3
    # connected: contacts within the tolerance of links span all discs
    found = sp.contacts(result, 0.012)
    assert found.mean >= 2 - 2 / discs
    label = np.arange(discs)
    for _ in range(discs):
        new = label.copy()
        np.minimum.at(new, found.pairs[:, 0], label[found.pairs[:, 1]])
        np.minimum.at(new, found.pairs[:, 1], label[found.pairs[:, 0]])
        new = new[new]
        if (new == label).all():
            break
        label = new
    assert (label == 0).all()
    events = result["events"].to_dataset()
    assert sorted(events["parents"].values.ravel()) == list(range(2 * discs - 2))
    assert events["sizes"].values[-1].sum() == discs
    mass = np.concatenate([result["mass"].values, events["masses"].values.sum(1)])
    np.testing.assert_allclose(events["masses"], mass[events["parents"].values])
    assert (np.diff(events["time"].values) >= 0).all()


def too_small(s: sp.System) -> bool:
    """Whether lists do not fit between periodic walls, at steps of 0.2 radii."""
    # half a period holds what a minimisation knows of, 1.6 diameters, and the thinnest skin, 1
    return bool(s.box.periodic.any()) and min(s.box.lengths) * 0.49 < 2.6 * 2 * s.radius.max()


VARIANTS = {
    "default": {},
    "rigid": {"rigid": True},
    "adaptive": {"adaptive": True},
    "smooth": {"constraint": "smooth"},
    "damped": {"form": "damped"},
    "damped smooth": {"form": "damped", "constraint": "smooth"},
    "plain": {"form": "plain"},
    "half a radius": {"step": 0.5},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_is_sound(variant):
    for k, walls in enumerate(("reflecting", "periodic", ("periodic", "reflecting"))):
        s = sp.lattice(144, (0.1, 0.3)[k % 2], seed=k, walls=walls)
        result = sp.simulate(s, TimeStepping(**VARIANTS[variant]), times=[0.0])
        assert_sound(result, 144)
        if variant in ("default", "rigid"):
            assert result.attrs["failures"] == 0


@pytest.mark.parametrize("number", range(12))
def test_all_kinds_of_systems_are_sound(number):
    """Radii and masses of all sizes, walls of all kinds."""
    s = system(number)
    method = TimeStepping(rigid=number % 4 == 3)
    if too_small(s):
        with pytest.raises(InputError, match="periodic axis must be"):
            sp.simulate(s, method, times=[0.0])
        return
    result = sp.simulate(s, method, times=[0.0])
    assert_sound(result, len(s))
    inside = result["position"].values
    room = s.radius[:, None] * (1 - 1e-9)
    beyond = np.maximum(room - inside, inside - s.box.lengths + room)[:, ~s.box.periodic]
    assert beyond.max(initial=0.0) < 0.1 * s.radius.max()
    if s.box.periodic.all():
        momentum = s.mass @ s.velocity
        np.testing.assert_allclose(s.mass @ result["velocity"].values, momentum, atol=1e-11)


@pytest.mark.parametrize("rigid", [False, True])
def test_centre_of_mass_moves_as_the_momentum_says(rigid):
    """Minimisations leave it where it is, for discs of any mass; walls are far away."""
    inner = sp.random(100, 0.2, radii=sp.lognormal_radii(1.2), seed=6)
    middle = inner.position - inner.box.lengths[0] / 2
    drift = np.array([0.1, 0.0])
    s = sp.System(middle + 500, drift - 0.1 * middle, inner.radius, inner.mass, box=1000)
    result = sp.simulate(s, TimeStepping(rigid=rigid), until=8.0, times=[0.0])
    assert result["events"].sizes["event"] > 50
    time = result.attrs["time_reached"]
    expected = s.mass @ (s.position + s.velocity * time)
    np.testing.assert_allclose(s.mass @ result["position"].values, expected, rtol=1e-13)


def mean(values: list[float]) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values)))


@pytest.mark.parametrize(
    ("settings", "excess"),
    [({"step": 0.5}, 0.07), ({"step": 0.1}, 0.015), ({"step": 0.1, "rigid": True}, 0.006)],
)
def test_short_steps_tend_to_the_exact_motion(settings, excess):
    """Contacts of a disc, within 1 %, exceed 2.013 by what was measured for 2500 discs; D is that
    of the exact motion, 1.66 at 0.3.
    """
    results = [
        sp.simulate(sp.lattice(400, 0.3, seed=k), TimeStepping(**settings), times=[0.0])
        for k in range(10)
    ]
    found, error = mean([sp.contacts(r).mean for r in results])
    assert found == pytest.approx(2.012 + excess, abs=4 * error + 0.006)
    found, error = mean([sp.box_dimension(r).value for r in results])
    assert found == pytest.approx(1.66, abs=4 * error + 0.01)


def near_but_apart(result: xr.DataTree) -> int:
    """Pairs with a gap of 0.2 to 2 % of a diameter, which no link holds."""
    s = sp.snapshot(result)
    square = ((s.position[:, None] - s.position) ** 2).sum(2)
    gap = np.sqrt(square[np.triu_indices(len(s), 1)]) / s.diameter - 1
    return int(((gap > 2e-3) & (gap < 2e-2)).sum())


@pytest.mark.parametrize(("links", "lost"), [("balanced", False), ("slack", True)])
def test_short_steps_leave_near_neighbours_where_they_are(links, lost):
    """A link that begins slack parts them, however short the step; one in balance does not."""
    systems = [sp.lattice(400, 0.1, seed=k) for k in range(30)]
    method = TimeStepping(step=0.0125, gap=1e-3, new_links=links)
    exact = sum(near_but_apart(sp.simulate(s)) for s in systems)
    found = sum(near_but_apart(sp.simulate(s, method, times=[0.0])) for s in systems)
    assert (found < exact - 4.5 * np.sqrt(exact + found)) == lost
    assert found < exact + 4.5 * np.sqrt(exact + found)


def test_two_discs_follow_the_exact_motion_until_they_meet():
    s = sp.System([[1, 2], [3, 2]], [[1, 0], [0, 0]], radius=0.5, box=(8, 4))
    errors = []
    for step in (0.5, 0.05):
        result = sp.simulate(s, TimeStepping(step=step), times=[0.0, 0.5], until=3.0)
        time = float(result["events"]["time"][0])
        assert 1.0 <= time <= 1.0 + 0.5 * step + 1e-12  # the step in which they meet has ended
        x, v = result["position"].values, result["velocity"].values
        np.testing.assert_allclose(v, [[0.5, 0]] * 2, atol=1e-12)
        errors.append(abs(x.mean(0)[0] - (2 + 0.5 * result.attrs["time_reached"])))
        assert result["series/clusters"].values.tolist() == [2, 2]
    assert max(errors) < 1e-12  # the centre of mass is exact


def test_walls_turn_clusters_back():
    """Along either axis, whatever their mass."""
    s = sp.System([[1, 1], [0.6, 3.4]], [[1, 0.5], [0, 0.5]], radius=0.5, mass=[1, 9], box=4)
    result = sp.simulate(s, TimeStepping(step=0.3), until=2.9, times=[0.0])
    np.testing.assert_allclose(result["position"], [[3.1, 2.45], [0.6, 2.15]], atol=1e-12)
    np.testing.assert_allclose(result["velocity"], [[-1, 0.5], [0, -0.5]], atol=1e-12)
    assert result["walls"]["wall_axis"].values.tolist() == [1, 0]


def test_failures_are_counted_and_the_run_goes_on_with_shorter_steps():
    s = sp.lattice(64, 0.3, seed=2)
    with pytest.warns(SmoluxWarning, match="half the length"):
        result = sp.simulate(s, TimeStepping(iterations=25), times=[0.0])
    assert result.attrs["failures"] > 0
    assert worst_overlap(result) < 1.1e-3
    with pytest.warns(SmoluxWarning) as told:
        hopeless = sp.simulate(s, TimeStepping(iterations=1, overlap=1e-12), times=[0.0])
    assert "however short" in str(told[-1].message)
    assert "however short" in hopeless.attrs["stopped"]
    assert worst_overlap(hopeless) < 1e-9
    with pytest.warns(SmoluxWarning):
        wild = sp.simulate(s, TimeStepping(alpha=50.0), times=[0.0])  # diverges, is not believed
    assert wild.attrs["failures"] > 0
    assert worst_overlap(wild) < 1.1e-3


def test_short_steps_in_a_dense_system_do_not_fail():
    """What is pushed moves as far as in long ones, further than its neighbours were known for."""
    s = sp.lattice(2500, 0.5, seed=3)
    assert sp.simulate(s, TimeStepping(step=0.1), times=[0.0]).attrs["failures"] == 0


def test_the_compiled_loop_can_be_kept():
    """A loop that is given a compiled function as a value is compiled in every process anew."""
    sp.simulate(sp.lattice(16, 0.2, seed=2), "time-stepping", times=[0.0])
    compiled = list(advance.overloads.values())
    assert compiled
    assert not any(c.library.has_dynamic_globals for c in compiled)


def test_nothing_moves():
    s = sp.System([[1, 1], [3, 3]], [[0, 0], [0, 0]], radius=0.5, box=4)
    with pytest.warns(SmoluxWarning, match="nothing moves"):
        sp.simulate(s, "time-stepping", times=[0.0])


@stopped
def test_no_replay():
    s = sp.lattice(16, 0.2, seed=2)
    result = sp.simulate(s, "time-stepping", times=[0.0], max_events=5)
    with pytest.raises(InputError, match="does not determine"):
        sp.replay(result, 0.0)
    with pytest.raises(InputError, match="does not determine"):
        sp.resume(result)


def test_mistakes_are_named():
    with pytest.raises(InputError) as error:
        TimeStepping(step=0.8, form="augmentd", constraint="smoth", beta=-1)
    for name in ("step", "form", "constraint", "beta"):
        assert f"{name} = " in str(error.value)
    with pytest.raises(InputError, match="times"):
        sp.simulate(sp.lattice(4), "time-stepping")


@pytest.mark.slow
@pytest.mark.parametrize("number", range(12))
def test_in_space(number):
    s = system(number, dimension=3, most=60)
    if not too_small(s):
        result = sp.simulate(s, TimeStepping(rigid=number % 2 == 1), times=[0.0])
        assert_sound(result, len(s))

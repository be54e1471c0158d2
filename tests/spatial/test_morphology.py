"""Shapes, contacts, order and dimensions: of patterns that are known, and of runs."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import smolux.spatial as sp
from smolux import InputError


def lines(n: int = 1500) -> sp.Snapshot:
    """Three lines across the box: the paper's first control."""
    s = np.linspace(0, 1, n // 3, endpoint=False)
    ends = [((0.1, 0.0), (0.3, 1.0)), ((0.0, 0.2), (1.0, 0.9)), ((0.9, 0.0), (0.5, 1.0))]
    x = [np.outer(1 - s, a) + np.outer(s, b) for a, b in ends]
    return sp.Snapshot(np.concatenate(x), 1e-4, sp.Box((1, 1)))


def square(side: int = 64) -> sp.Snapshot:
    """Discs in contact on a lattice: the second."""
    i, j = np.indices((side, side)).reshape(2, -1)
    return sp.Snapshot(np.stack([i, j], 1) + 0.5, 0.5, sp.Box((side, side)))


def sierpinski(level: int = 8) -> sp.Snapshot:
    """The triangle of Sierpinski by its corners: the third; right-angled, so that boxes fit it."""
    i = np.arange(2**level)
    a, b = np.nonzero((i[:, None] & i[None, :]) == 0)
    return sp.Snapshot(np.stack([a, b], 1) + 0.5, 0.5, sp.Box((2**level, 2**level)))


class TestControls:
    def test_lines(self):
        assert sp.box_dimension(lines()).value == pytest.approx(1, abs=0.06)

    def test_square_lattice(self):
        fit = sp.box_dimension(square(128))
        # a row of boxes that the wall cuts short counts as one: the few large ones are too many
        rows = np.floor(127.5 / fit.x) + 1
        np.testing.assert_array_equal(fit.y[fit.x >= 1], (rows**2)[fit.x >= 1])
        assert fit.value == pytest.approx(2, abs=0.08)
        large = sp.box_dimension(square(256), least=1000)
        assert large.value == pytest.approx(2, abs=0.02)

    def test_sierpinski(self):
        fit = sp.box_dimension(sierpinski())
        assert fit.value == pytest.approx(np.log(3) / np.log(2), abs=0.04)
        halves = np.isin(fit.x, 2.0 ** np.arange(9))
        np.testing.assert_array_equal(fit.y[halves], 3 ** np.arange(halves.sum()))

    def test_cube_in_space(self):
        x = np.stack(np.indices((16, 16, 16)).reshape(3, -1), 1) + 0.5
        s = sp.Snapshot(x, 0.5, sp.Box((16,) * 3))
        fit = sp.box_dimension(s, largest=4097)
        np.testing.assert_array_equal(fit.y[:17:4], 8 ** np.arange(5))

    def test_rods_and_discs_by_mass(self):
        """Rods have R_g ~ m, filled squares R_g ~ sqrt m, both exactly for many discs."""
        for d, power in ((1, 1.0), (2, 2.0)):
            x, cluster = [], []
            for k, side in enumerate((6, 9, 13, 20, 30) if d == 2 else (30, 60, 120, 240)):
                grid = np.stack(np.indices((side, side if d == 2 else 1)).reshape(2, -1), 1)
                x.append(grid + 100.0 * k)
                cluster.append(np.full(len(grid), k))
            s = sp.Snapshot(np.concatenate(x), 0.5, cluster=np.concatenate(cluster))
            fit = sp.mass_dimension(s)
            assert fit.value == pytest.approx(power, abs=0.02)
            n, r = fit.x[fit.used], fit.y[fit.used]
            known = stats.linregress(np.log(n), np.log(r))
            assert fit.slope == pytest.approx(known.slope, rel=1e-10)
            half = stats.t.ppf(0.975, len(n) - 2) * known.stderr
            assert 1 / fit.low - 1 / fit.high == pytest.approx(2 * half, rel=1e-4)


class TestShapes:
    def test_gyration_of_an_ellipse_turned(self):
        """The tensor of points on an ellipse has the halves of the squared axes."""
        phase = np.linspace(0, 2 * np.pi, 360, endpoint=False)
        turn = np.deg2rad(150)
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        x = np.stack([3 * np.cos(phase), np.sin(phase)], 1) @ rotation.T + 7
        ds = sp.shapes(sp.Snapshot(x, 0.1))
        np.testing.assert_allclose(ds["principal"].values, [[4.5, 0.5]], rtol=1e-12)
        assert float(ds["aspect_ratio"][0]) == pytest.approx(3)
        assert float(ds["orientation"][0]) == pytest.approx(turn)
        assert float(ds["radius_of_gyration"][0]) == pytest.approx(np.sqrt(5))
        np.testing.assert_allclose(ds["centre"].values, [[7, 7]])

    def test_clusters_against_a_plain_loop(self):
        rng = np.random.default_rng(1)
        x, mass = rng.normal(size=(50, 3)), rng.uniform(1, 3, 50)
        cluster = rng.integers(0, 4, 50) * 7
        ds = sp.shapes(sp.Snapshot(x, 0.1, cluster=cluster, mass=mass), by_mass=True)
        for k, name in enumerate(ds["cluster"].values):
            mine = cluster == name
            tensor = np.cov(x[mine].T, aweights=mass[mine], ddof=0)
            np.testing.assert_allclose(ds["gyration"].values[k], tensor, rtol=1e-12)
            assert float(ds["mass"][k]) == pytest.approx(mass[mine].sum())
            u = ds["direction"].values[k]
            np.testing.assert_allclose(tensor @ u, ds["principal"].values[k, 0] * u, atol=1e-12)

    def test_one_disc_and_a_line(self):
        s = sp.Snapshot([[0, 0], [0, 0], [1, 0], [2, 0]], 0.5, cluster=[0, 1, 1, 1])
        ds = sp.shapes(s)
        assert np.isnan(ds["aspect_ratio"].values[0])
        assert np.isinf(ds["aspect_ratio"].values[1])
        assert np.sin(ds["orientation"].values[1]) == pytest.approx(0, abs=1e-12)


class TestContacts:
    def test_a_tree_of_discs_of_two_sizes(self):
        s = sp.Snapshot([[0, 0], [1.5, 0], [1.5, 1.0], [4, 0]], [1, 0.5, 0.5, 1])
        found = sp.contacts(s, 1e-9)
        np.testing.assert_array_equal(found.per_disc, [1, 2, 1, 0])
        assert found.kappa() == pytest.approx(1 / 6)
        assert found.kappa(include_self=True) == pytest.approx(2 / 6)
        assert sp.contacts(s, 0.7).per_disc.sum() == 8  # 1 and 3, but not 2 and 3

    def test_lattices_have_all_neighbours_across_periodic_walls(self):
        s = sp.Snapshot(square(8).position + 8 * 3, 0.5, sp.Box((8, 8), "periodic"))
        assert (sp.contacts(s, 1e-9).per_disc == 4).all()
        x = np.stack(np.indices((5, 5, 5)).reshape(3, -1), 1) + 0.5
        cube = sp.contacts(sp.Snapshot(x, 0.5, sp.Box((5,) * 3, "periodic")), 1e-9)
        assert cube.kappa() == pytest.approx(6 / 12)


class TestOrder:
    @pytest.mark.parametrize(
        "walls", ["reflecting", "periodic", ("periodic", "reflecting", "reflecting")]
    )
    @pytest.mark.parametrize("d", [2, 3])
    def test_points_without_order(self, walls, d):
        """g = 1 and S = 1; counts are Poissonian, means of S exponential, within 4.5 sigma."""
        n, box = 1000, sp.Box((9, 7, 8)[:d], walls if isinstance(walls, str) else walls[:d])
        x = np.random.default_rng(d).uniform(size=(n, d)) * box.lengths
        s = sp.Snapshot(x, 0.01, box)
        g = sp.pair_distribution(s, np.linspace(0, 3.4, 12))
        pairs = g["neighbours"].values * n / 2
        sigma = g["g"].values / np.sqrt(pairs)
        # points near to each other share their neighbours: a little more than Poisson
        assert (np.abs(g["g"].values - 1) < 4.5 * sigma + 0.03).all()
        factor = sp.structure_factor(s, shells=8)
        z = (factor["S"].values - 1) * np.sqrt(factor["vectors"].values)
        assert np.abs(z).max() < 4.5

    @pytest.mark.parametrize(
        ("d", "share"), [(2, np.pi - 8 / 3 + 1 / 2), (3, (4 / 3 - 3 / 2) * np.pi + 8 / 5 - 1 / 6)]
    )
    def test_what_is_expected_between_walls(self, d, share):
        """Two points of a square or a cube are nearer than its side with a known probability."""
        x = 0.5 + 0.01 * np.eye(3, d)
        g = sp.pair_distribution(sp.Snapshot(x, 1e-3, sp.Box((1,) * d)), [0, 1])
        # each of three has two neighbours, where independent ones would have twice the share
        np.testing.assert_allclose(g["neighbours"], 2.0)
        np.testing.assert_allclose(g["g"], 1 / share, rtol=1e-12)

    def test_pair_counts_against_all_pairs(self):
        rng = np.random.default_rng(3)
        s = sp.Snapshot(
            rng.uniform(size=(60, 2)) * 4, 0.1, sp.Box((4, 4), ("periodic", "reflecting"))
        )
        edges = np.array([0.2, 0.5, 1.0, 1.9])
        apart = s.box.nearest(s.position[:, None] - s.position)
        r = np.sqrt((apart**2).sum(-1))[~np.eye(60, dtype=bool)]
        counts = np.histogram(r, edges)[0] / 60
        np.testing.assert_allclose(sp.pair_distribution(s, edges)["neighbours"], counts, rtol=1e-14)

    def test_structure_factor_against_the_sum(self):
        rng = np.random.default_rng(4)
        x = rng.uniform(size=(40, 2)) * (2, 4)
        factor = sp.structure_factor(sp.Snapshot(x, 0.1, sp.Box((2, 4))), shells=2)
        # one vector in the first shell, and of lengths of 2 and sqrt(5) four in the second
        numbers = np.array([[0, 1], [0, 2], [1, 0], [1, 1], [1, -1]])
        power = np.abs(np.exp(2j * np.pi * x @ (numbers / (2, 4)).T).sum(0)) ** 2 / 40
        np.testing.assert_allclose(factor["S"], [power[0], power[1:].mean()], rtol=1e-12)
        length = np.array([1, (2 + np.sqrt(5)) / 2])
        np.testing.assert_allclose(factor["q"], np.pi / 2 * length, rtol=1e-12)

    def test_bragg_peaks(self):
        factor = sp.structure_factor(square(16), shells=16)
        np.testing.assert_allclose(factor["S"].values[:15], 0, atol=1e-20)
        last = factor.isel(q=-1)  # the shell of (16, 0) and (0, 16), each of S = N
        assert float(last["S"] * last["vectors"]) == pytest.approx(2 * 256)


@pytest.fixture(scope="module")
def ended() -> dict[float, list[xr.DataTree]]:
    """Runs of the paper's initial condition to one cluster, with 400 discs."""
    return {
        phi: [sp.simulate(sp.lattice(400, phi, seed=k), times=[0.0]) for k in range(8)]
        for phi in (0.1, 0.3)
    }


def mean(values: list[float]) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values)))


class TestRuns:
    @pytest.mark.parametrize(
        ("phi", "by_tolerance"),
        [(0.1, (2.0, 2.03, 2.07, 2.15, 2.33, 3.03)), (0.3, (2.0, 2.04, 2.09, 2.19, 2.42, 3.28))],
    )
    def test_contacts(self, ended, phi, by_tolerance):
        """A tree to rounding; by tolerance as measured for 2500 discs."""
        for result in ended[phi]:
            assert sp.contacts(result, 1e-9).mean == pytest.approx(2 - 2 / 400, abs=1e-12)
        for tolerance, expected in zip(
            (1e-9, 0.02, 0.05, 0.1, 0.2, 0.5), by_tolerance, strict=True
        ):
            found, error = mean([sp.contacts(r, tolerance).mean for r in ended[phi]])
            # 400 discs have 2 / 400 - 2 / 2500 fewer links, and more of an edge
            assert found == pytest.approx(expected, abs=0.03 * expected**2 / 4 + 4 * error)
        kappa = [sp.contacts(r).kappa(include_self=True) for r in ended[phi]]
        assert np.mean(kappa) == pytest.approx(0.503, abs=0.004)

    @pytest.mark.parametrize(("phi", "dimension", "aspect"), [(0.1, 1.40, 1.50), (0.3, 1.66, 1.09)])
    def test_dimension_and_aspect_ratio(self, ended, phi, dimension, aspect):
        found, error = mean([sp.box_dimension(r).value for r in ended[phi]])
        assert found == pytest.approx(dimension, abs=4 * error + 0.005)
        found, error = mean([float(sp.shapes(r)["aspect_ratio"][0]) for r in ended[phi]])
        assert found == pytest.approx(aspect, abs=4 * error + 0.005)

    @pytest.mark.parametrize(("phi", "dimension"), [(0.1, 1.621), (0.3, 1.835)])
    def test_dimension_by_mass(self, phi, dimension):
        """At a thousandth of the clusters, as for 250,000 discs; within four sigmas."""
        s = sp.lattice(62_500, phi, seed=0)
        fit = sp.mass_dimension(sp.simulate(s, clusters=62, times=[0.0]))
        assert fit.high - fit.low < 0.2
        assert fit.value == pytest.approx(dimension, abs=fit.high - fit.low)

    def test_periodic_clusters_are_whole(self):
        """A cluster is as large as its links make it, wherever the walls cut it."""
        s = sp.random(200, 0.1, walls="periodic", seed=4)
        result = sp.simulate(s, clusters=12, times=[0.0])
        moved = sp.System(
            s.position + s.box.lengths[0] * np.array([0.37, 0.61]),
            s.velocity,
            s.radius,
            s.mass,
            box=s.box,
        )
        other = sp.simulate(moved, clusters=12, times=[0.0])
        for name in ("size", "radius_of_gyration", "aspect_ratio"):
            np.testing.assert_allclose(sp.shapes(result)[name], sp.shapes(other)[name], rtol=1e-8)
        start = sp.snapshot(result, 0.0)
        assert len(sp.shapes(start)["cluster"]) == 200


def test_mistakes_are_named():
    for make, words in (
        (lambda: sp.Snapshot([1, 2], -1.0), ["position", "radius"]),
        (lambda: sp.Snapshot([[1, 2]], 1.0, sp.Box((1, 1, 1)), mass=[1, 2]), ["box", "mass"]),
        (lambda: sp.contacts(square(8), -0.1), ["tolerance"]),
        (lambda: sp.pair_distribution(square(8), [1, 20]), ["edges"]),
        (lambda: sp.pair_distribution(sp.Snapshot([[0, 0]], 1.0)), ["free space"]),
        (lambda: sp.structure_factor(square(8), 0), ["shells"]),
        (lambda: sp.box_dimension(square(2)), ["window"]),
        (lambda: sp.mass_dimension(square(8)), ["least"]),
    ):
        with pytest.raises(InputError) as error:
            make()
        assert all(word in str(error.value) for word in words)

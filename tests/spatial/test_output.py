"""Trajectories, figures, movies."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import smolux as sx
import smolux.spatial as sp
from smolux import plotting


@pytest.fixture(scope="module")
def result():
    return sp.simulate(sp.lattice(36, 0.3, seed=2, walls=("periodic", "reflecting")))


def read_xyz(file):
    """Frames of an extended XYZ file: the comment line and the columns as text."""
    lines = file.read_text().splitlines()
    while lines:
        n = int(lines[0])
        yield lines[1], [line.split() for line in lines[2 : 2 + n]]
        lines = lines[2 + n :]


def test_extended_xyz(result, tmp_path):
    end = result.attrs["time_reached"]
    frames = list(read_xyz(sp.write_trajectory(result, tmp_path / "a.xyz", [0, 1.0, end])))
    assert len(frames) == 3
    for (comment, rows), time in zip(frames, [0.0, 1.0, end], strict=True):
        assert f"Time={time!r} " in comment
        assert 'Lattice="6.0 0 0 0 6.0 0 0 0 0.618' in comment
        assert 'pbc="T F F"' in comment
        state = sp.replay(result, time)
        table = np.array([row[1:] for row in rows], float)
        box = sp.system_of(result).box
        np.testing.assert_allclose(table[:, :2], box.wrap(state["position"]), rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(table[:, 2], 0)
        np.testing.assert_allclose(table[:, 3], state["radius"], rtol=1e-9)
        np.testing.assert_allclose(table[:, 5:7], state["velocity"], rtol=1e-9)
        np.testing.assert_array_equal(table[:, 8], state["cluster"])
    assert len(list(read_xyz(sp.write_trajectory(result, tmp_path / "b.xyz", frames=4)))) == 4


@pytest.fixture(scope="module")
def spheres():
    return sp.simulate(sp.random(20, 0.05, dimension=3, seed=3, walls="periodic"), until=2.0)


def test_extended_xyz_by_another_reader(result, spheres, tmp_path):
    read = pytest.importorskip("ase.io").read
    for tree, name in ((result, "a.xyz"), (spheres, "b.xyz")):
        system, times = sp.system_of(tree), [0.0, 1.0]
        d, box = system.dimension, system.box
        frames = read(sp.write_trajectory(tree, tmp_path / name, times), index=":")
        assert [frame.info["Time"] for frame in frames] == times
        for frame, time in zip(frames, times, strict=True):
            state = sp.replay(tree, time)
            np.testing.assert_allclose(frame.cell.lengths()[:d], box.lengths, rtol=1e-15)
            np.testing.assert_array_equal(frame.pbc[:d], box.periodic)
            np.testing.assert_allclose(
                frame.positions[:, :d], box.wrap(state["position"]), rtol=1e-9, atol=1e-9
            )
            np.testing.assert_allclose(frame.arrays["radius"], state["radius"], rtol=1e-9)
            np.testing.assert_allclose(frame.arrays["velo"][:, :d], state["velocity"], rtol=1e-9)
            np.testing.assert_array_equal(frame.arrays["cluster"], state["cluster"])


def test_gsd(result, spheres, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    for tree, name in ((result, "a.gsd"), (spheres, "b.gsd")):
        system, times = sp.system_of(tree), [0.0, 1.0, 2.0]
        d, box = system.dimension, system.box
        with hoomd.open(sp.write_trajectory(tree, tmp_path / name, times)) as trajectory:
            assert len(trajectory) == len(times)
            for number, (frame, time) in enumerate(zip(trajectory, times, strict=True)):
                state, particles = sp.replay(tree, time), frame.particles
                assert frame.configuration.step == number
                assert frame.configuration.dimensions == d
                sides = frame.configuration.box
                np.testing.assert_allclose(sides[:d], box.lengths, rtol=1e-6)
                np.testing.assert_array_equal(sides[3:], 0)
                at = particles.position[:, :d] + np.array(box.lengths) / 2
                np.testing.assert_allclose(at, box.wrap(state["position"]), atol=1e-5)
                assert (abs(particles.position) <= sides[:3] / 2).all()
                np.testing.assert_allclose(particles.diameter, 2 * state["radius"], rtol=1e-6)
                np.testing.assert_allclose(particles.velocity[:, :d], state["velocity"], atol=1e-6)
                np.testing.assert_allclose(particles.mass, system.mass, rtol=1e-6)
                np.testing.assert_array_equal(particles.charge, state["cluster"])
                np.testing.assert_array_equal(frame.log["particles/cluster"], state["cluster"])
                np.testing.assert_array_equal(frame.log["time"], [time])


def test_a_missing_package_is_named(result, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "gsd", None)
    monkeypatch.setitem(sys.modules, "gsd.hoomd", None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(sx.InputError, match=r'pip install "smolux\[spatial\]"'):
        sp.write_trajectory(result, tmp_path / "a.gsd")
    with pytest.raises(sx.InputError, match=r'pip install "smolux\[movie\]"'):
        plotting.movie(result, tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"path": "a.pdb"}, "must end in .xyz or .gsd"),
        ({"times": [1e9]}, "must lie between 0 and the time reached"),
        ({"times": [2, 1]}, "must ascend"),
        ({"frames": 0}, "frames = 0"),
    ],
)
def test_mistakes(result, tmp_path, arguments, words):
    arguments = {"path": "a.xyz"} | arguments
    with pytest.raises(sx.InputError) as caught:
        sp.write_trajectory(result, tmp_path / arguments.pop("path"), **arguments)
    assert words in str(caught.value)


def test_figures(result):
    for figure in (
        plotting.discs(result),
        plotting.discs(result, 1.0, colour="cluster", width="double"),
        plotting.coarsening(result),
    ):
        assert isinstance(figure, Figure)
    drawn = plotting.discs(result, 1.0).axes[0].collections[0]
    x = sp.system_of(result).box.wrap(sp.replay(result, 1.0)["position"])
    np.testing.assert_allclose(drawn.get_offsets(), x)
    # diameters, in the units of the box
    np.testing.assert_allclose(drawn.get_widths(), 2 * result["radius"])
    with pytest.raises(sx.InputError, match="colour = 'red'"):
        plotting.discs(result, colour="red")


def test_the_mean_field_is_drawn_in_numbers_of_the_box():
    """Beside K = 1, for which the share of the size k is p (1 - p)**(k - 1)."""
    tree = sp.simulate(sp.lattice(36, 0.3, seed=2), times=[0.0, 1.0, 4.0])
    mixed = sx.solve(sx.Model(sx.kernels.Constant()), [0.0, 1.0, 4.0])
    top, bottom = plotting.mean_field([(tree, mixed)]).axes
    box, well_mixed = top.lines
    np.testing.assert_array_equal(box.get_ydata(), tree["series/clusters"])
    np.testing.assert_allclose(well_mixed.get_ydata(), 36 * 2 / (2 + np.array([0.0, 1.0, 4.0])))
    p = 2 / (2 + 4.0)
    edges = tree["series/bin_lower"].values, tree["series/bin_upper"].values
    share = [(1 - p) ** (a - 1) - (1 - p) ** (b - 1) for a, b in zip(*edges, strict=True)]
    np.testing.assert_allclose(bottom.lines[-1].get_ydata(), share / np.subtract(*edges[::-1]))


def test_figures_of_order_and_of_dimensions(result):
    order = sp.pair_distribution(result)
    figure = plotting.pair_distribution(order, label="one")
    plotting.pair_distribution(order, ax=figure.axes[0], label="two")
    one, two = figure.axes[0].lines
    np.testing.assert_array_equal(one.get_ydata(), order["g"])
    np.testing.assert_allclose(one.get_xdata() * 2 * result["radius"].values[0], order["r"])
    assert one.get_color() != two.get_color()
    boxes = sp.box_dimension(result)
    size = np.array([5.0, 30, 60, 90, 200])
    mass = sp.Dimension(1.6, 1.5, 1.7, size, 2 * size ** (1 / 1.6), size > 10, 1 / 1.6, np.log(2))
    for fit in (boxes, mass):
        ax = plotting.dimension(fit).axes[0]
        outside, inside, line = ax.lines
        assert len(outside.get_xdata()) == (~fit.used).sum()
        np.testing.assert_array_equal(inside.get_ydata(), fit.y[fit.used])
        slope = np.polyfit(np.log(line.get_xdata()), np.log(line.get_ydata()), 1)[0]
        assert slope == pytest.approx(fit.slope)
        assert f"{fit.low:.3f} to {fit.high:.3f}" in ax.texts[0].get_text()
    shaded = ax.collections[0].get_paths()[0].vertices
    assert shaded[:, 1].max() == pytest.approx(
        2 * 200 ** (1 / 1.6) * (200 / np.exp(np.log(size[1:]).mean())) ** (1 / 1.5 - 1 / 1.6)
    )
    for wrong in (plotting.pair_distribution, plotting.dimension):
        with pytest.raises(sx.InputError, match="must be what"):
            wrong(result["series"].to_dataset())


def test_a_disc_that_touched_nothing_is_grey(result):
    first = result["first_contact"].values
    time = float(np.median(first))
    faces = plotting.discs(result, time).axes[0].collections[0].get_facecolors()
    grey = (faces[:, :3] == 0.75).all(1)
    np.testing.assert_array_equal(grey, first > time)


def test_movie(result, tmp_path):
    image = pytest.importorskip("PIL.Image")
    file = plotting.movie(result, tmp_path / "a.gif", frames=3, pixels=120)
    with image.open(file) as picture:
        assert picture.n_frames == 3
        assert picture.size[0] == 120
        first = np.asarray(picture.convert("RGB"))
        picture.seek(2)
        assert (np.asarray(picture.convert("RGB")) != first).any()
    with pytest.raises(sx.InputError) as caught:
        plotting.movie(result, tmp_path / "a.avi", rate=0, pixels=121, colour="red")
    assert len(caught.value.problems) == 4


def test_movie_in_mp4(result, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    times = [0.0, 1.0, result.attrs["time_reached"]]
    file = plotting.movie(result, tmp_path / "a.mp4", times, rate=5, pixels=160)
    reader = ffmpeg.read_frames(str(file))
    about = next(reader)
    width, height = about["size"]
    assert (width, about["fps"], about["codec"]) == (160, 5, "h264")
    shown = [np.frombuffer(f, np.uint8).reshape(height, width, 3).astype(float) for f in reader]
    assert len(shown) == len(times)
    # the same pictures as in the GIF, but for its palette and the compression of the MP4
    gif = plotting.movie(result, tmp_path / "a.gif", times, pixels=160)
    with pytest.importorskip("PIL.Image").open(gif) as picture:
        for k in range(len(shown)):
            picture.seek(k)
            drawn = np.asarray(picture.convert("RGB"), float)
            off = [abs(drawn - other).mean() for other in shown]
            assert off[k] < 5
            assert sorted(off)[1] > 3 * off[k]  # and far from the others

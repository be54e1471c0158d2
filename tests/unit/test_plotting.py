"""Figures: they are made for every kind of result, show the right numbers and are fit for print."""

import json
import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
import synthetic
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg

import smolux as sx
from smolux import plotting
from smolux.analysis.statistics import Sample, mean_interval
from smolux.model_dict import model_to_dict
from smolux.plotting.distribution import Classes

TIMES = np.concatenate([[0.0], np.geomspace(0.1, 50, 9)])


def unfinished(ds):
    """Some replicas stopped early, none reached the last time."""
    ds = ds.copy(deep=True)
    for name in ("number_density", "moment", "n", "n_bin", "largest", "particles", "collisions"):
        ds[name][2:, 6:] = np.nan
        ds[name][:, 9:] = np.nan
    return ds


@pytest.fixture(scope="module")
def many():
    return synthetic.constant_dataset(particles=3000, times=TIMES)


@pytest.fixture(scope="module")
def solved():
    return synthetic.solver_dataset(times=TIMES)


KINDS = ("replicas", "one replica", "unfinished", "few particles", "solver", "dense")


@pytest.fixture(scope="module")
def datasets(many, solved):
    few = synthetic.constant_dataset(particles=12, times=TIMES)
    dense = synthetic.constant_dataset(particles=200, times=np.linspace(0, 20, 81))
    one = many.isel(replica=[0])
    return dict(zip(KINDS, (many, one, unfinished(many), few, solved, dense), strict=True))


FIGURES = {
    "moments": lambda ds, ref: plotting.moments(ds),
    "moments against a solver": lambda ds, ref: plotting.moments(ds, (0, 2), reference=ref),
    "time_series": lambda ds, ref: plotting.time_series(ds, "n", size=2),
    "collisions": lambda ds, ref: plotting.time_series(ds, "collisions"),
    "size_distribution": lambda ds, ref: plotting.size_distribution(ds),
    "size_distribution against a solver": lambda ds, ref: plotting.size_distribution(
        ds, reference=ref, width="double"
    ),
    "clusters": lambda ds, ref: plotting.clusters(ds),
    "clusters alone": lambda ds, ref: plotting.clusters(ds, reference=None, width="double"),
    "scaling": lambda ds, ref: plotting.scaling(ds, reference=ref),
    "oscillations": lambda ds, ref: plotting.oscillations(ds, reference=ref),
    "oscillations, narrow": lambda ds, ref: plotting.oscillations(ds, width="single"),
    "comparison": lambda ds, ref: plotting.comparison({"this": ds, "solver": ref}),
    "comparison with the exact": lambda ds, ref: plotting.comparison(
        {"this": ds, "again": ds}, "moment", order=3
    ),
}

#: enough for the rarer kinds of result
COMMON = ("size_distribution", "clusters", "comparison")


def boxes(figure):
    """Boxes of all texts that say something, in pixels."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw_without_rendering()
    texts = [t for legend in figure.legends for t in legend.get_texts()]
    for ax in figure.axes:
        texts += [ax.xaxis.label, ax.yaxis.label, ax.title, *ax.texts, *drawn_ticks(ax)]
        texts += ax.get_legend().get_texts() if ax.get_legend() else []
    return {t: t.get_window_extent(renderer) for t in texts if t.get_text()}


def drawn_ticks(ax):
    """Tick labels within the limits of the axes."""
    found = []
    for axis, limits in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
        for tick in axis.get_major_ticks():
            inside = limits[0] <= tick.get_loc() <= limits[1]
            if inside and tick.label1.get_visible() and tick.label1.get_text():
                found.append(tick.label1)
    return found


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *((name, "replicas") for name in FIGURES),
        *((name, kind) for kind in KINDS[1:] for name in COMMON),
    ],
)
def test_every_figure_of_every_kind_of_result(name, kind, datasets):
    figure = FIGURES[name](datasets[kind], datasets["solver"])
    found = boxes(figure)
    for text, box in found.items():
        # nothing clipped
        assert box.x0 >= -1, text
        assert box.y0 >= -1, text
        assert box.x1 <= figure.bbox.x1 + 1, text
        assert box.y1 <= figure.bbox.y1 + 1, text
        assert text.get_fontsize() >= 4.9, text
    # nothing printed over anything else
    items = list(found.items())
    for k, (text, box) in enumerate(items):
        for other, its in items[:k]:
            inner = box.padded(-1)
            overlap = (
                inner.x0 < its.x1 and its.x0 < inner.x1 and inner.y0 < its.y1 and its.y0 < inner.y1
            )
            assert not overlap, (text, other)
    # legends lie outside the axes
    for ax in figure.axes:
        if ax.get_legend():
            assert ax.get_legend().get_window_extent().y0 >= ax.get_window_extent().y1 - 1
        assert ax.get_xlabel() or ax.get_shared_x_axes().get_siblings(ax) != [ax]
        assert ax.get_ylabel()


def bars(ax):
    """Centres and half widths of the error bars of one colour after the other."""
    found = []
    for container in ax.containers:
        line, _, (segments,) = container
        x, y = line.get_data()
        half = [(s[1, 1] - s[0, 1]) / 2 for s in segments.get_segments()]
        found.append((np.asarray(x), np.asarray(y), np.array(half)))
    return found


def test_moments_show_means_and_their_intervals(many):
    ax = plotting.moments(many, orders=(2,)).axes[0]
    (x, y, half), *rest = bars(ax)
    assert not rest
    sample = Sample.of(many["moment"].sel(order=2).values)
    mean = sample.mean
    lower, upper = mean_interval(sample)
    # the start has no place on a logarithmic axis
    assert np.array_equal(x, TIMES[1:])
    assert np.allclose(y, mean[1:])
    assert np.allclose(half, (upper - lower)[1:] / 2)
    ends = [s[:, 1] for s in ax.containers[0][2][0].get_segments()]
    assert np.allclose(ends, np.stack([lower, upper], axis=1)[1:])
    (line,) = [line for line in ax.lines if line.get_linestyle() == "-"]
    assert np.allclose(line.get_ydata(), 1 + line.get_xdata())


def test_one_replica_has_open_markers_and_no_bars(many):
    ax = plotting.moments(many.isel(replica=[0]), orders=(2,), reference=None).axes[0]
    assert not ax.containers
    (line,) = ax.lines
    assert line.get_markerfacecolor() == "white"


def test_many_times_make_a_band():
    ds = synthetic.constant_dataset(particles=200, times=np.linspace(0, 20, 81))
    ax = plotting.time_series(ds).axes[0]
    assert not ax.containers
    assert len(ax.collections) == 1
    dashed = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert np.allclose(dashed[0].get_ydata(), 2 / (dashed[0].get_xdata() + 2))


def test_zero_counts_are_left_out_and_bars_to_zero_reach_the_edge():
    ds = synthetic.constant_dataset(particles=500, times=(1.0,))
    ax = plotting.size_distribution(ds, reference=None).axes[0]
    x, y, half = bars(ax)[0]
    assert np.all(y > 0)
    density = Classes.of(ds, 0).density
    assert len(x) == np.sum(density.mean(0) > 0) < density.shape[1]
    # where one replica alone has a cluster, the interval contains zero
    assert np.any(half > y)
    assert ax.get_ylim()[0] > 0


def test_equal_counts_are_no_certainty():
    ds = synthetic.constant_dataset(particles=500, times=(1.0,), replicas=2)
    ds["n"][:, 0, 4] = 0.01
    ax = plotting.size_distribution(ds, reference=None).axes[0]
    assert 5 not in bars(ax)[0][0]
    (open_one,) = [line for line in ax.lines if line.get_markerfacecolor() == "white"]
    assert 5 in open_one.get_xdata()


def test_classes_hold_all_clusters_and_join_sizes_and_bins(solved):
    table = Classes.of(solved, 8)
    assert np.array_equal(table.lower[1:], table.upper[:-1])
    assert table.lower[:4].tolist() == [1, 2, 3, 4]
    total = np.sum(table.density * (table.upper - table.lower))
    assert total == pytest.approx(float(solved["number_density"][0, 8]), rel=1e-9)


def test_points_of_wide_classes_lie_on_the_exact_curve(solved):
    table = Classes.of(solved, 8)
    t = TIMES[8]
    mean = table.density[0]
    shown = mean > 1e-9 * mean.max()
    at = table.positions()[shown]
    exact = (2 / (t + 2)) ** 2 * (t / (t + 2)) ** (at - 1)
    assert np.max(np.abs(np.log(mean[shown] / exact))) < 0.02
    # the plain centre is off by far more in the tail
    centre = np.sqrt(table.lower * (table.upper - 1))[shown]
    plain = (2 / (t + 2)) ** 2 * (t / (t + 2)) ** (centre - 1)
    assert np.max(np.abs(np.log(mean[shown] / plain))) > 0.2
    assert np.all((at >= table.lower[shown]) & (at <= table.upper[shown] - 1))


def test_deviations_of_clusters_are_those_of_the_comparison(many):
    bottom = plotting.clusters(many).axes[1]
    known = sx.summary(many)["number_density"].sel(statistic="sigmas").values
    assert np.allclose(bottom.lines[-1].get_ydata(), known)
    assert len(plotting.clusters(many.isel(replica=[0])).axes) == 1


def test_comparison_measures_by_the_solver(many, solved):
    figure = plotting.comparison({"a": many, "solver": solved, "b": many})
    both = bars(figure.axes[1])
    assert len(both) == 2
    percent = 100 * (TIMES + 2) / 2
    known = percent * many["number_density"].mean("replica").values - 100
    lower, upper = mean_interval(Sample.of(many["number_density"].values))
    for x, y, half in both:
        assert np.allclose(y, known[1:])
        assert np.allclose(half, (percent * (upper - lower) / 2)[1:])
        assert np.allclose(x, TIMES[1:], rtol=0.05)
    # side by side
    assert np.all(both[0][0] < both[1][0])


def test_labels_have_units():
    records = synthetic.constant_kernel(
        particles=100, replicas=2, units={"time": "s", "moment": "m$^{-3}$"}
    )
    ds = sx.results.to_dataset(synthetic.model(), records)
    ax = plotting.moments(ds).axes[0]
    assert ax.get_xlabel() == "time $t$ (s)"
    assert ax.get_ylabel() == "moment $M_p$ (m$^{-3}$)"


def test_the_scaled_form_does_not_depend_on_the_mass(solved):
    mass = 3 / (1 + solved["time"])
    names = ("number_density", "moment", "n", "n_bin")
    other = solved.assign({name: mass * solved[name] for name in names})
    both = [plotting.scaling(ds).axes[0].lines for ds in (solved, other)]
    assert len(both[0]) == 4
    for one, two in zip(*both, strict=True):
        np.testing.assert_allclose(one.get_xydata(), two.get_xydata(), rtol=1e-12, atol=1e-300)


def test_the_exact_mass_of_rate_equations_is_without_the_gel(solved):
    model = sx.Model(sx.kernels.Multiplicative())
    ds = solved.assign_attrs(model=json.dumps(model_to_dict(model)), gel="inert")
    exact = plotting.moments(ds, orders=(1,)).axes[0].lines[0]
    assert len(exact.get_xdata()) > 100
    np.testing.assert_allclose(exact.get_ydata(), np.minimum(1.0, 1.0 / exact.get_xdata()))


def test_the_cycle_of_an_oscillation_begins_at_the_start_that_is_given(many):
    _, cycle = plotting.oscillations(many, start=1.0).axes
    late = many.isel(replica=0, time=TIMES >= 1.0)
    np.testing.assert_array_equal(cycle.lines[0].get_xdata(), late["number_density"])
    np.testing.assert_array_equal(cycle.lines[0].get_ydata(), late["moment"].sel(order=2))


def test_own_axes(many):
    figure = mpl.figure.Figure()
    left, right = figure.subplots(1, 2)
    assert plotting.moments(many, ax=left) is figure
    assert plotting.size_distribution(many, ax=right) is figure
    assert left.lines
    assert right.lines


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_the_same_figure_gives_the_same_bytes(suffix, many, tmp_path):
    paths = [tmp_path / f"{k}.{suffix}" for k in (1, 2)]
    for path in paths:
        plotting.save(plotting.moments(many, orders=(2,)), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert b"CreationDate" not in paths[0].read_bytes()


def test_width_of_a_journal_column(many, tmp_path):
    for width, millimetres in (("single", 86), ("double", 178)):
        path = plotting.save(plotting.moments(many, width=width), tmp_path / f"{width}.png")
        pixels = mpl.image.imread(path).shape[1]
        assert pixels / 300 * 25.4 == pytest.approx(millimetres, abs=0.1)


def test_save_says_what_is_wrong(many, tmp_path):
    figure = plotting.moments(many)
    with pytest.raises(sx.InputError, match=r"\.png, \.pdf or \.svg"):
        plotting.save(figure, tmp_path / "a.docx")
    with pytest.raises(sx.InputError, match="create it first"):
        plotting.save(figure, tmp_path / "none/a.png")
    plotting.save(figure.axes[0], tmp_path / "a.png")
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda ds: plotting.moments(ds, orders=(7,)), "order = 7"),
        (lambda ds: plotting.moments(ds, orders=()), "must be a list of different finite"),
        (lambda ds: plotting.moments(ds, reference="exat"), "reference = 'exat'"),
        (lambda ds: plotting.moments(ds, width="triple"), "width = 'triple'"),
        (lambda ds: plotting.time_series(ds, "mometn"), "did you mean 'moment'"),
        (lambda ds: plotting.size_distribution(ds, times=[3.0]), "no output at t = 3; the nearest"),
        (lambda ds: plotting.size_distribution(unfinished(ds), times=[50.0]), "no replica reached"),
        (lambda ds: plotting.comparison({}), "dictionary of names and results"),
    ],
)
def test_mistakes(draw, message, many):
    with pytest.raises(sx.InputError, match=message):
        draw(many)


def test_unknown_exact_solution_is_no_obstacle():
    ds = sx.results.to_dataset(
        sx.Model(kernel=sx.kernels.Ballistic()), synthetic.constant_kernel(particles=100)
    )
    ax = plotting.moments(ds, orders=(0,)).axes[0]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["$M_{0}$"]


def test_settings_and_backend_of_the_user_stay(many, tmp_path):
    code = (
        "import sys, matplotlib as mpl\n"
        # reading the backend would choose one
        "keys = [k for k in mpl.rcParams if not k.startswith('backend')]\n"
        "before = [mpl.rcParams[k] for k in keys]\n"
        "import synthetic\n"
        "from smolux import plotting\n"
        "plotting.save(plotting.clusters(synthetic.constant_dataset(particles=50)), sys.argv[1])\n"
        "assert [mpl.rcParams[k] for k in keys] == before\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    here = str(tmp_path / "a.png")
    folder = synthetic.__file__.rpartition("/")[0]
    subprocess.run([sys.executable, "-c", code, here], check=True, cwd=folder, timeout=100)


def test_plotting_does_not_touch_the_result(many):
    before = many.copy(deep=True)
    for draw in FIGURES.values():
        draw(many, many)
    xr.testing.assert_identical(many, before)

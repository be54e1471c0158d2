"""Labels of figures, and legends that show what is drawn."""

import numpy as np
import pytest
import synthetic
from matplotlib.figure import Figure

import smolux as sx
from smolux import plotting
from smolux.plotting.curves import Look, draw_values
from smolux.plotting.style import label_axis, quantity, time_label


@pytest.mark.parametrize(
    ("time", "units", "label"),
    [
        (2.5, None, "$t = 2.5$"),
        (1e4, "s", "$t = 10^{4}$ s"),
        (1.5e-7, "1", r"$t = 1.5 \times 10^{-7}$"),
    ],
)
def test_time_label(time, units, label):
    assert time_label(time, units) == label


@pytest.mark.parametrize(
    ("units", "label"),
    [("1", "n"), ("s", "n (s)"), ("m-3", "n (m$^{-3}$)"), ("kg m**-3", "n (kg m$^{-3}$)")],
)
def test_units_are_printed_with_raised_powers(units, label):
    assert quantity("n", units) == label


def test_many_points_are_dots_where_dots_are_asked_for():
    x = np.arange(1.0, 61)
    values = np.stack([x, x + 1, x + 3])
    ax = Figure().subplots()
    draw_values(ax, x, values, Look.number(0), line=False)
    assert [line.get_linestyle() for line in ax.lines if len(line.get_xdata()) == 60] == ["None"]
    assert ax.containers


def dataset(times, scale=1.0, **settings):
    units = {"time": "s", "number_density": "m-3", "moment": "m-3"}
    records = synthetic.constant_kernel(
        particles=200, replicas=3, times=times, units=units, **settings
    )
    records.values["number_density"] *= scale
    records.values["moment"] *= scale
    return sx.results.to_dataset(synthetic.model(), records)


LINEAR = np.linspace(0.0, 3.0, 7)
#: 40 of these have a place on a logarithmic axis
LOG = np.concatenate([[0.0], np.geomspace(0.01, 100.0, 40)])
OVER_TIME = {
    "time_series": plotting.time_series,
    "moments": plotting.moments,
    "clusters": plotting.clusters,
    "comparison": lambda ds, **options: plotting.comparison({"a": ds, "b": ds}),
}


@pytest.mark.parametrize("power", [12, -9])
@pytest.mark.parametrize("name", OVER_TIME)
def test_a_power_of_ten_stands_in_the_label_and_not_over_the_legend(name, power):
    ds = dataset(LINEAR, 10.0**power)
    if name == "comparison":  # beside a solution, as the exact one is not of this scale
        figure = plotting.comparison({"a": ds, "b": ds.assign(particles=np.nan * ds["particles"])})
    else:
        figure = OVER_TIME[name](ds, reference=None)
    figure.draw_without_rendering()
    top = figure.axes[0]
    for ax in figure.axes:
        assert ax.xaxis.get_offset_text().get_text() == ""
        assert ax.yaxis.get_offset_text().get_text() == ""
    if top.get_yscale() == "linear":
        found = int(np.floor(np.log10(top.get_ylim()[1])))
        assert top.get_ylabel().endswith(f" ($10^{{{found}}}$ m$^{{-3}}$)")
        low, high = top.get_ylim()
        ticks = zip(top.get_yticks(), top.get_yticklabels(), strict=True)
        shown = [(y, t.get_text()) for y, t in ticks if low <= y <= high]
        assert len(shown) > 2
        for y, text in shown:
            assert float(text.replace("\N{MINUS SIGN}", "-")) * 10.0**found == pytest.approx(y)
    else:
        assert top.get_ylabel().endswith(" (m$^{-3}$)")


def test_a_power_of_ten_without_a_unit_and_in_time():
    ax = Figure().subplots()
    ax.plot([0.0, 2.5e8], [-3.0, 9000.0])
    label_axis(ax, "x", "time $t$", "s")
    label_axis(ax, "y", "n", "1")
    assert ax.get_xlabel() == "time $t$ ($10^{8}$ s)"
    assert ax.get_ylabel() == "n"
    ax = Figure().subplots()
    ax.plot([0.0, 1.0], [0.0, 3e-7])
    label_axis(ax, "y", "n")
    assert ax.get_ylabel() == "n ($10^{-7}$)"


def drawn_kinds(ax):
    """Dots, lines and lines with dots that are drawn in colour: those of results."""
    return {(line.get_linestyle() != "None", line.get_marker() not in ("None", "", None))
            for line in ax.lines if len(line.get_xdata()) > 2}  # fmt: skip


def legend_kinds(ax):
    return {(line.get_linestyle() != "None", line.get_marker() not in ("None", "", None))
            for line in ax.get_legend().get_lines()}  # fmt: skip


@pytest.mark.parametrize("name", OVER_TIME)
@pytest.mark.parametrize(
    ("times", "dots"),
    [(LINEAR, True), (LOG, True), (np.append(LOG, 200.0), False), (np.linspace(0, 3, 41), False)],
)
def test_the_legend_shows_what_is_drawn(name, times, dots):
    """Dots for dots and lines for lines, also where t = 0 has no place on the axis."""
    ds = dataset(times)
    settings = {} if name == "comparison" else {"reference": None}
    top = OVER_TIME[name](ds, **settings).axes[0]
    kinds = legend_kinds(top) - ({(True, False)} if name == "comparison" else set())
    if dots:
        assert (False, True) in drawn_kinds(top)
        assert kinds == {(False, True)}
    else:
        assert drawn_kinds(top) == {(True, False)}
        assert kinds <= {(True, False)}


def test_a_solver_of_few_times_is_a_line_with_points_in_the_legend_too():
    ds, solved = dataset(LINEAR), sx.solve(synthetic.model(), LINEAR, tolerance=1e-4)
    for figure in (
        plotting.moments(solved, reference=None),
        plotting.time_series(solved, reference=None),
    ):
        assert drawn_kinds(figure.axes[0]) == legend_kinds(figure.axes[0]) == {(True, True)}
    figure = plotting.time_series(ds, reference=solved)
    assert legend_kinds(figure.axes[0]) == {(False, True), (True, True)}


def test_a_start_that_is_not_shown_is_told():
    shown, hidden = dataset(LINEAR), dataset(LOG)
    for draw in OVER_TIME.values():
        assert draw(shown).axes[-1].get_xlabel() == "time $t$ (s)"
        assert draw(hidden).axes[-1].get_xlabel() == "time $t$ (s), without $t = 0$"
    later = hidden.isel(time=slice(1, None))
    assert plotting.moments(later).axes[0].get_xlabel() == "time $t$ (s)"


def test_every_time_of_the_legend_lies_within_the_axes():
    """Also one whose densities are far below those of the others; none where nothing is left."""
    ds = dataset(LINEAR, seed=3)
    ds["n"].loc[{"time": 3.0}] *= 1e-12
    ds["n_bin"].loc[{"time": 3.0}] *= 1e-12
    times = [1.0, 2.0, 3.0]
    ax = plotting.size_distribution(ds, times=times, reference=None).axes[0]
    lowest = float(ds["n"].sel(time=3.0).mean("replica").max())
    assert ax.get_ylim()[0] < lowest < ax.get_ylim()[1]
    assert len(ax.get_legend().get_lines()) == 3
    ds["n"].loc[{"time": 3.0}] = 0.0
    ds["n_bin"].loc[{"time": 3.0}] = 0.0
    ax = plotting.size_distribution(ds, times=times, reference=None).axes[0]
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["$t = 1$ s", "$t = 2$ s"]

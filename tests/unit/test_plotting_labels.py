"""Labels of figures, and legends that show what is drawn."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from smolux.plotting.curves import Look, draw_values
from smolux.plotting.style import quantity, time_label


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

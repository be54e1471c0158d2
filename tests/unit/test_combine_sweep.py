"""The points of a sweep as one dataset and as a table."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic

from smolux.analysis import sweep_table
from smolux.analysis.sweeps import combine_sweep

AXES = {"density": [1.0, 2.0, 4.0], "speed": [1.0, 10.0]}


def test_each_point_has_its_place_and_the_table_its_last_time():
    """The last key runs fastest; K = 1, of which the number is 2 / (2 + t)."""
    ends = {(c, v): c * v for c in AXES["density"] for v in AXES["speed"]}
    points = [synthetic.solver_dataset(times=(0.0, end)) for end in ends.values()]
    points = [ds.assign_coords(time=[0.0, 1.0]) for ds in points]
    found = combine_sweep(AXES, points, [""] * 6)
    for (c, v), end in ends.items():
        number = found["number_density"].sel(density=c, speed=v).values
        np.testing.assert_allclose(number, [[1.0, 2 / (2 + end)]])
    header, rows = sweep_table(found)
    column = header.index("clusters")
    assert [(float(row[0]), float(row[1])) for row in rows] == list(ends)
    shown = [float(row[column]) for row in rows]
    assert shown == pytest.approx([2 / (2 + end) for end in ends.values()], rel=1e-4)

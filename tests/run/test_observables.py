"""What is declared once is everywhere: columns of the state, variables of the result."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import runs

import shared
import smolux as sx
from shared import VARYING
from smolux import observables
from smolux.core import state as states
from smolux.core.columns import Columns, Rule
from smolux.core.state import AT, EVENTS, HIGHEST, MASS_OUT, TRIALS
from smolux.observables import OBSERVABLES, Observable
from smolux.results.dataset import VARIABLES
from smolux.stochastic import checkpoint as checkpoints
from smolux.stochastic.replicas import empty_state

DOCS = Path(__file__).parents[2] / "docs"


def small_plan() -> Any:
    p = sx.processes
    model = replace(runs.model(), processes=[p.Aggregation(), p.Removal(0.1)])
    return runs.plan(model, [0.5, 1.0, 2.0], "size-class", sizes=3)


def test_columns_are_numbered_as_they_are_declared() -> None:
    columns = Columns()
    numbers = [columns("a", Rule.SUM), columns("b", Rule.MAXIMUM, extensive=True)]
    numbers.append(columns("c", Rule.ADDED, each=True))
    assert numbers == [0, 1, 2]
    assert columns.extensive == [1]
    assert columns.under(Rule.ADDED, 4).tolist() == [2, 3]
    with pytest.raises(ValueError, match="'d': comes twice, or after one for each"):
        columns("d", Rule.SUM)
    whole = np.array([5.0, 5.0, 5.0, 5.0])
    columns.merge(whole, [np.array([1.0, 2.0, 3.0, 4.0]), np.array([10.0, 20.0, 30.0, 40.0])])
    assert whole.tolist() == [11.0, 20.0, 38.0, 49.0]


def test_every_array_of_the_state_has_a_rule() -> None:
    assert tuple(states.RULES) == states.State._fields
    plan = small_plan()
    state = empty_state(plan, np.zeros((1, 4), np.uint64))
    for name, columns in states.COLUMNS.items():
        # the last column stands for as many as there are processes
        more = len(plan.model.processes) - 1 if name != "count" else 0
        assert getattr(state, name).shape == (1, len(columns) + more)


def test_every_column_is_made_up_by_its_rule() -> None:
    """Two sub-volumes with numbers of their own in everything that is recorded."""
    plan = small_plan()
    total, *parts = (states.new_tally(1, plan.grid, 3, 2) for _ in range(3))
    for first, part in zip((1000.0, 2000.0), parts, strict=True):
        for k, values in enumerate(part):
            values[:] = first + 100 * k + np.arange(values.size).reshape(values.shape)
    before = empty_state(plan, np.zeros((1, 4), np.uint64))
    before.count[:], before.clock[:], before.events[:] = 7, 7.0, 7
    observables.add_up(total, slice(1, 3), parts, before)
    assert np.isnan(total.scalars[:, 0]).all()
    np.testing.assert_array_equal(total.scalars[0, 1:, AT], parts[0].scalars[0, :2, AT])
    np.testing.assert_array_equal(total.scalars[0, 1:, HIGHEST], parts[1].scalars[0, :2, HIGHEST])
    added = {"collisions", "mass_in", "mass_out", "events"}
    recorded = {o.name for o in OBSERVABLES if o.recorded}
    assert recorded == added | {"particles", "volume"}
    for name in recorded:
        found, *each = (observables.recorded(tally, name)[0] for tally in (total, *parts))
        np.testing.assert_array_equal(found[1:], (each[0] + each[1])[:2] + 7 * (name in added))
    for name in ("counts", "bins", "sums"):
        found, *each = (getattr(tally, name)[0] for tally in (total, *parts))
        np.testing.assert_array_equal(found[1:], (each[0] + each[1])[:2])


@shared.stopped
@pytest.mark.parametrize("subvolumes", [1, 2])
def test_a_variable_declared_elsewhere_is_in_the_result(
    subvolumes: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Nothing else is to be changed, or compiled; a run that is stopped goes on with it."""
    given: dict[str, Any] = {
        "particles": 4000, "replicas": 2, "seed": 3, "sizes": 4, "subvolumes": subvolumes,
        "remix": 0.3, "method": "acceptance-rejection",
    }  # fmt: skip
    times = [0.0, 0.5, 2.0]
    expected = sx.simulate(runs.model(VARYING), times, **given)
    dims = ("replica", "time")
    more = (
        Observable("candidates", dims, "candidates so far", "", count=TRIALS),
        Observable("offered", (*dims, "process"), "attempts so far", "", process="attempts"),
        Observable("left", ("replica",), "mass that left", "", clock=MASS_OUT),
    )
    monkeypatch.setattr(observables, "OBSERVABLES", OBSERVABLES + more)
    path = tmp_path / "run.npz"
    ds = sx.simulate(runs.model(VARYING), times, checkpoint=path, time_limit=1e-9, **given)
    while not ds.attrs["complete"]:
        ds = sx.resume(path)
    runs.assert_same(expected, ds.drop_vars([o.name for o in more]))
    found = ds["candidates"].values
    assert (np.diff(found) > 0).all()
    assert (found >= ds["collisions"]).all()
    # the last output time comes after some more that are drawn and not yet known to come too late
    assert (np.abs(found[:, -1] - ds["attempts"].sum("process").values) < 2000).all()
    assert ds["offered"].dims == (*dims, "process")
    assert (ds["offered"] == 0).all()  # encounters are counted together
    assert (ds["left"] == 0.0).all()
    assert ds["candidates"].attrs == {"long_name": "candidates so far", "units": "1"}


def test_a_column_of_the_tally_has_a_rule() -> None:
    with pytest.raises(ValueError, match="phase: say how sub-volumes make it up"):
        _ = Observable("phase", ("replica", "time"), "", "", count=states.PHASE).merging
    for o in OBSERVABLES:
        assert not o.recorded or isinstance(o.merging, Rule)
        assert VARIABLES[o.name] == (o.dims, o.long_name)
    assert next(o for o in OBSERVABLES if o.name == "collisions").count == EVENTS


def test_a_checkpoint_with_other_columns_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.npz"
    checkpoints.save(path, small_plan(), [])
    assert checkpoints.load(path)[1] == []
    monkeypatch.setitem(states.COLUMNS, "missed", Columns())
    with pytest.raises(sx.InputError, match="reads it with other columns of the state"):
        checkpoints.load(path)


def test_the_reference_lists_exactly_what_is_declared() -> None:
    sys.path.insert(0, str(DOCS / "_ext"))
    try:
        from reference_tables import filled
    finally:
        sys.path.pop(0)
    page = filled((DOCS / "reference" / "dataset.md").read_text())
    listed = re.findall(r"^\| `(\w+)` \| (replica[\w, ]*) \| (.+) \|$", page, re.MULTILINE)
    assert [(n, tuple(d.split(", ")), about) for n, d, about in listed] == [
        (o.name, o.dims, o.about) for o in OBSERVABLES
    ]
    assert "written by" not in page
    dims = {d for o in OBSERVABLES for d in o.dims}
    assert dims == set(
        re.findall(r"^\| `(\w+)` \| ", page.partition("## Variables")[0], re.MULTILINE)
    )

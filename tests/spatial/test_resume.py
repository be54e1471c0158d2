"""Stopping a run and going on with it."""

from __future__ import annotations

import signal

import numpy as np
import pytest
from flights import system

import smolux as sx
import smolux.spatial as sp
from shared import stopped
from smolux import results
from smolux.spatial.methods.windowed import WindowedRun


def merges(result):
    """Pairs of discs, as sets, and times."""
    events = result["events"].to_dataset()
    return np.sort(np.stack([events["first"], events["second"]], 1), 1), events["time"].values


@stopped
@pytest.mark.parametrize("number", range(8))
def test_a_run_with_stops_makes_the_merges_of_one_without(number, tmp_path):
    s = system(number)
    whole = sp.simulate(s)
    n = len(s)
    part = sp.simulate(s, ("windowed", "cells", "all-pairs")[number % 3], max_events=n // 3)
    assert "limit of" in part.attrs["stopped"]
    results.save(part, tmp_path / "part.nc")
    part = sp.resume(results.load(tmp_path / "part.nc"), clusters=max(2, n // 10))
    done = sp.resume(part)
    pairs, times = merges(whole)
    again, when = merges(done)
    np.testing.assert_array_equal(again, pairs)
    np.testing.assert_allclose(when, times, rtol=1e-9)
    np.testing.assert_allclose(done["position"], whole["position"], atol=1e-8)
    np.testing.assert_array_equal(done["events"]["parents"], whole["events"]["parents"])
    assert done["walls"].sizes["reflection"] == whole["walls"].sizes["reflection"]
    assert done.attrs["seed"] == whole.attrs["seed"]
    assert not done.attrs["stopped"]


def test_what_is_reached_already():
    s = sp.lattice(36, 0.2, seed=1)
    end = sp.simulate(s)
    end.attrs["wall_seconds"] = 1e6
    again = sp.resume(end)
    assert again.attrs["wall_seconds"] > 1e6
    np.testing.assert_array_equal(again["position"], end["position"])
    np.testing.assert_array_equal(merges(again)[0], merges(end)[0])
    with pytest.raises(sx.InputError, match=r"until = 0\.1: the run has reached"):
        sp.resume(end, until=0.1)


@stopped
def test_ctrl_c_leaves_what_was_reached(monkeypatch):
    """It comes while the compiled loop runs; the events of that loop must not be lost."""
    # which is ignored by what a shell runs in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)
    s = sp.lattice(40_000, 0.1, seed=1)
    monkeypatch.setattr("smolux.spatial.simulation._BUDGET", 8000)
    advance = WindowedRun.advance

    def interrupted(self, *limits):
        code = advance(self, *limits)
        signal.raise_signal(signal.SIGINT)  # what came meanwhile is seen when the loop returns
        return code

    monkeypatch.setattr(WindowedRun, "advance", interrupted)
    with pytest.raises(sx.Interrupted) as caught:
        sp.simulate(s)
    monkeypatch.undo()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    part = caught.value.dataset
    assert part.attrs["stopped"] == "interrupted"
    assert 1 < len(np.unique(part["cluster"])) == 40_000 - part["events"].sizes["event"]
    same = sp.replay(part, part.attrs["time_reached"])
    np.testing.assert_allclose(same["position"], part["position"], atol=1e-9)
    done = sp.resume(part)
    assert done["events"].sizes["event"] == 39_999
    k = part["events"].sizes["event"]
    np.testing.assert_array_equal(merges(done)[0][:k], merges(part)[0])
    assert np.abs(done["events"]["gap"]).max() < 1e-9

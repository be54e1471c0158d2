"""The result of a spatial run: a tree of datasets; back from it to a system and to any instant."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from smolux import results
from smolux.checks import numbers
from smolux.errors import InputError
from smolux.spatial.box import Box
from smolux.spatial.system import System

from .genealogy import merger_tree
from .replay import Merging, replayed
from .trace import ORDERS, Log, Series, Trace, size_edges

Float = NDArray[np.float64]

#: what the result says of itself, so that files can be told apart
KIND = "spatial"

_SERIES = {
    "clusters": (("time",), "number of clusters"),
    "mean_mass": (("time",), "mean mass of a cluster"),
    "largest": (("time",), "discs in the largest cluster"),
    "largest_mass": (("time",), "mass of the heaviest cluster"),
    "kinetic_energy": (("time",), "kinetic energy of the clusters"),
    "momentum": (("time", "axis"), "total momentum"),
    "moment": (("time", "order"), "sum over clusters of the number of discs to a power"),
    "n_bin": (("time", "bin"), "clusters by number of discs"),
}

_DISCS = {
    "position": (("disc", "axis"), "position at the end; clusters are whole"),
    "velocity": (("disc", "axis"), "velocity at the end"),
    "cluster": (("disc",), "cluster at the end, named by its disc of the least number"),
    "first_contact": (("disc",), "time at which a disc first touched another"),
    "radius": (("disc",), "radius"),
    "mass": (("disc",), "mass"),
    "initial_position": (("disc", "axis"), "position at the start"),
    "initial_velocity": (("disc", "axis"), "velocity at the start"),
}

_EVENTS = {
    "time": (("event",), "time of a merge"),
    "first": (("event",), "one of the two discs in contact"),
    "second": (("event",), "the other one"),
    "parents": (
        ("event", "side"),
        "clusters that merge, of the first and of the second disc, as nodes of the merger tree: "
        "0 to N - 1 are the discs, N + m is what merge m made",
    ),
    "child": (("event",), "node of the merger tree that is made"),
    "sizes": (("event", "side"), "discs of the two clusters"),
    "masses": (("event", "side"), "mass of the two clusters"),
    "point": (("event", "axis"), "where the two discs touched, in the box"),
    "relative_speed": (("event",), "relative speed of the two clusters"),
    "impact_parameter": (
        ("event",),
        "distance of the line of relative motion of one disc from the centre of the other",
    ),
    "energy_loss": (("event",), "kinetic energy lost"),
    "gap": (("event",), "distance of the two surfaces at the recorded time: rounding"),
}

_WALLS = {
    "time": (("reflection",), "time at which a cluster touched a wall"),
    "disc": (("reflection",), "a disc of the cluster"),
    "wall_axis": (("reflection",), "axis of the wall"),
    "at_rest": (
        ("reflection",),
        "1 if the cluster fills the box along the axis and came to rest, else 0",
    ),
    "place": (("reflection",), "number of merges before it"),
    "more": (
        ("reflection",),
        "reflections of the cluster along the axis after this one that are only counted",
    ),
    "until": (("reflection",), "time of the last of these; 0 if there are none"),
}


def _dataset(table: dict[str, Any], values: dict[str, Any], **coordinates: Any) -> xr.Dataset:
    ds = xr.Dataset({name: (dims, values[name]) for name, (dims, _) in table.items()}, coordinates)
    for name, (_, text) in table.items():
        ds[name].attrs |= {"long_name": text, "units": "1"}
    return ds


def to_tree(
    system: System,
    trace: Trace,
    series: Series,
    merging: Merging | None,
    attributes: dict[str, Any],
) -> xr.DataTree:
    """Put a run into the tree that every spatial method returns.

    Parameters
    ----------
    system : System
    trace : Trace
    series : Series
    merging : Merging, optional
        What each merge was, if the log determines the motion.
    attributes : dict
        Further attributes: method, wall time, ...
    """
    log, n = trace.log, len(system)
    merges = log.merges
    edges = size_edges(n)
    series_ds = _dataset(
        _SERIES,
        vars(series),
        time=series.time,
        order=np.array(ORDERS),
        bin=np.sqrt(edges[:-1] * (edges[1:] - 1.0)),
        bin_lower=("bin", edges[:-1]),
        bin_upper=("bin", edges[1:]),
    )
    discs = {
        "position": trace.position,
        "velocity": trace.velocity,
        "cluster": trace.cluster,
        "first_contact": _first_contacts(log, n),
        "radius": system.radius,
        "mass": system.mass,
        "initial_position": system.position,
        "initial_velocity": system.velocity,
    }
    root = _dataset(_DISCS, discs)
    root.attrs = results.provenance(
        "Ballistic aggregation of " + ("discs" if system.dimension == 2 else "spheres"),
        {
            "kind": KIND,
            "model": _described(system),
            "seed": system.origin.get("seed"),
            "time_reached": trace.time,
            "complete": not trace.stopped,
            "stopped": trace.stopped,
            "warnings": trace.warnings + ([trace.stopped] if trace.stopped else []),
            **attributes,
        },
    )
    d = system.dimension
    code = -1 - log.second[~merges].astype(np.int64)
    walls = {
        "time": log.time[~merges],
        "disc": log.first[~merges],
        "wall_axis": code % d,
        "at_rest": code // d,
        "place": np.cumsum(merges)[~merges],
        "more": log.more[~merges],
        "until": log.until[~merges],
    }
    # beside each other: what is above would hand its times down
    return xr.DataTree.from_dict(
        {
            "/": root,
            "series": series_ds,
            "events": _events(log, merging, system),
            "walls": _dataset(_WALLS, walls),
        }
    )


def _events(log: Log, merging: Merging | None, system: System) -> xr.Dataset:
    merges, discs = log.merges, len(system)
    values = {
        "time": log.time[merges],
        "first": log.first[merges],
        "second": log.second[merges],
        "child": discs + np.arange(int(merges.sum()), dtype=np.int32),
    }
    if merging is not None:
        values |= {
            "parents": merging.parents,
            "sizes": merging.sizes,
            "masses": merging.masses,
            "point": merging.point,
            "relative_speed": merging.speed,
            "impact_parameter": merging.impact,
            "energy_loss": merging.loss,
            "gap": merging.gap,
        }
    else:
        values |= merger_tree(log.first[merges], log.second[merges], system.mass)
    return _dataset({name: _EVENTS[name] for name in _EVENTS if name in values}, values)


def _first_contacts(log: Log, discs: int) -> Float:
    merges = log.merges
    first = np.full(discs, np.nan)
    # from the last to the first, so that the first stays
    for side in (log.first, log.second):
        mine, when = side[merges][::-1], log.time[merges][::-1]
        earlier = np.full(discs, np.nan)
        earlier[mine] = when
        first = np.fmin(first, earlier)
    return first


def _described(system: System) -> dict[str, Any]:
    return {
        "discs": len(system),
        "volume_fraction": system.volume_fraction,
        "box": list(system.box.lengths),
        "walls": list(system.box.walls),
        "wall_contact": system.wall_contact,
        **{key: value for key, value in system.origin.items() if key != "volume_fraction"},
    }


def system_of(result: xr.DataTree) -> System:
    """Return the system that a run started from.

    Parameters
    ----------
    result : xarray.DataTree
        Of `smolux.spatial.simulate`, or loaded from its file.

    Returns
    -------
    System
    """
    import json

    _check(result)
    model = json.loads(result.attrs["model"])
    known = {"discs", "box", "walls", "wall_contact"}
    ds = result.to_dataset()
    return System(
        ds["initial_position"].values,
        ds["initial_velocity"].values,
        ds["radius"].values,
        ds["mass"].values,
        box=Box(model["box"], model["walls"]),
        wall_contact=model["wall_contact"],
        origin={key: value for key, value in model.items() if key not in known},
    )


def log_of(result: xr.DataTree) -> Log:
    """Return the log of a run: merges and reflections in the order in which they happened."""
    _check(result)
    events, walls = result["events"].to_dataset(), result["walls"].to_dataset()
    d = result.sizes["axis"]
    code = -1 - walls["wall_axis"].values - d * walls["at_rest"].values
    # a reflection comes after as many merges as its place says
    merges = np.arange(events.sizes["event"])
    order = np.argsort(np.concatenate([merges + 0.5, walls["place"].values]), kind="stable")
    log = Log.of(
        np.concatenate([events["time"].values, walls["time"].values])[order],
        np.concatenate([events["first"].values, walls["disc"].values])[order].astype(np.int32),
        np.concatenate([events["second"].values, code])[order].astype(np.int32),
    )
    if "more" in walls:  # files of earlier versions have an entry for each reflection
        log.more[log.second < 0] = walls["more"].values
        log.until[log.second < 0] = walls["until"].values
    return log


def trace_of(result: xr.DataTree) -> Trace:
    """Return what a run by an exact method left behind, to go on from.

    Raises
    ------
    InputError
        If its log does not determine the motion.
    """
    log = log_of(result)
    _check_exact(result)
    ds = result.to_dataset()
    return Trace(
        float(result.attrs["time_reached"]),
        ds["position"].values,
        ds["velocity"].values,
        ds["cluster"].values.astype(np.int32),
        log,
    )


def replay(result: xr.DataTree, time: float) -> xr.Dataset:
    """Return the discs at an instant, from the log of a run; exact to rounding.

    Parameters
    ----------
    result : xarray.DataTree
        Of `smolux.spatial.simulate`, by a method that is exact.
    time : float
        From zero to what the run reached. An event at this very time has happened.

    Returns
    -------
    xarray.Dataset
        ``position``, ``velocity``, ``cluster`` of every disc, with its radius and mass.

    Raises
    ------
    InputError
        If the time was not reached, or if the log does not determine the motion.
    """
    _check(result)
    reached = float(result.attrs["time_reached"])
    instant = numbers("time", time)
    if instant.ndim or not 0 <= instant <= reached:
        raise InputError(f"time = {time!r}: must lie between 0 and {reached:g}, which was reached")
    _check_exact(result)
    values = replayed(system_of(result), log_of(result), float(time))
    root = result.to_dataset()
    values |= {"radius": root["radius"].values, "mass": root["mass"].values}
    ds = _dataset({name: _DISCS[name] for name in values}, values)
    for name in ("position", "velocity", "cluster"):
        ds[name].attrs["long_name"] = name
    return ds.assign_attrs(time=float(time), model=result.attrs["model"])


def _check_exact(result: xr.DataTree) -> None:
    if "point" not in result["events"]:
        raise InputError(
            f"result: was made by the method {result.attrs.get('method')!r}, whose log does not "
            "determine the motion; use an event-driven method"
        )


def _check(result: Any) -> None:
    if not isinstance(result, xr.DataTree) or result.attrs.get("kind") != KIND:
        raise InputError(
            "result: must be what smolux.spatial.simulate returned, or its file loaded"
        )

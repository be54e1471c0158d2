"""Trajectories for viewers such as OVITO: extended XYZ, and GSD."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from smolux.checks import numbers
from smolux.errors import InputError
from smolux.runtime.files import replacing
from smolux.spatial.box import Box
from smolux.spatial.system import System

from .replay import Replay
from .result import log_of, system_of

Float = NDArray[np.float64]

_LINES = 1 << 16


def write_trajectory(
    result: xr.DataTree,
    path: str | os.PathLike[str],
    times: ArrayLike | None = None,
    *,
    frames: int = 100,
) -> Path:
    """Write the motion of a run, with radius, velocity and cluster of every disc.

    Parameters
    ----------
    result : xarray.DataTree
        Of `smolux.spatial.simulate`, by a method that is exact.
    path : str or path
        Ends in .xyz (extended XYZ, a text) or .gsd (of HOOMD-blue; needs the extra ``spatial``).
    times : array_like of shape (T,), optional
        Ascending instants, within what the run reached.
    frames : int
        How many instants, if none are given: evenly spaced from the start to the end.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    InputError
        If the suffix is another one, a time was not reached, or a package is missing.

    Notes
    -----
    Positions are wrapped into the box along periodic axes. Discs are written with z = 0 in a box as
    thick as the largest of them. In OVITO radii are those of the file, and clusters can be coloured
    by the property "cluster"; in GSD it stands in the log and, for viewers without, as the charge.
    """
    writers: dict[str, Callable[..., None]] = {".xyz": _write_xyz, ".gsd": _write_gsd}
    suffix = Path(path).suffix.lower()
    if suffix not in writers:
        raise InputError(f"path = {os.fspath(path)!r}: must end in .xyz or .gsd")
    instants = instants_of(result, times, frames)
    if suffix == ".gsd":
        _gsd()
    with replacing(path) as temporary:
        writers[suffix](temporary, result, instants)
    return Path(path)


def instants_of(result: xr.DataTree, times: ArrayLike | None, frames: int) -> Float:
    """Return the instants to show, checked.

    Raises
    ------
    InputError
        If they do not ascend, or were not reached.
    """
    log_of(result)  # is it a spatial result at all
    reached = float(result.attrs["time_reached"])
    if "point" not in result["events"]:
        raise InputError(
            f"result: was made by the method {result.attrs.get('method')!r}, whose log does not "
            "determine the motion; use an event-driven method"
        )
    if times is None:
        if not isinstance(frames, (int, np.integer)) or frames < 1:
            raise InputError(f"frames = {frames!r}: must be a whole number, one or more")
        return np.linspace(0.0, reached, frames)
    instants = np.atleast_1d(numbers("times", times))
    if not (instants.size and (instants >= 0).all() and (instants <= reached).all()):
        raise InputError(f"times = {times!r}: must lie between 0 and the time reached, {reached:g}")
    if (np.diff(instants) < 0).any():
        raise InputError(f"times = {times!r}: must ascend")
    return instants


def states(result: xr.DataTree, instants: Float) -> Any:
    """Yield time, positions, velocities and clusters of all discs, going through a run once."""
    system, log = system_of(result), log_of(result)
    replay = Replay(system, log)
    for time in instants:
        replay.to(float(time))
        yield float(time), *replay.positions(float(time))


def _cell(system: System) -> tuple[list[float], list[bool]]:
    """Sides and periodicity of the box in three dimensions."""
    sides, periodic = list(system.box.lengths), list(system.box.periodic)
    if system.dimension == 2:
        sides, periodic = [*sides, 2 * float(system.radius.max())], [*periodic, False]
    return sides, [bool(p) for p in periodic]


def _in_space(x: Float) -> Float:
    return x if x.shape[1] == 3 else np.hstack([x, np.zeros((len(x), 1))])


def _write_xyz(file: Path, result: xr.DataTree, instants: Float) -> None:
    system = system_of(result)
    sides, periodic = _cell(system)
    lattice = f"{sides[0]!r} 0 0 0 {sides[1]!r} 0 0 0 {sides[2]!r}"
    pbc = " ".join("T" if p else "F" for p in periodic)
    with file.open("w", encoding="ascii") as out:
        for time, x, v, cluster in states(result, instants):
            out.write(
                f'{len(x)}\nLattice="{lattice}" pbc="{pbc}" Time={time!r} '
                "Properties=species:S:1:pos:R:3:radius:R:1:mass:R:1:velo:R:3:cluster:I:1\n"
            )
            columns = np.hstack(
                [
                    _in_space(system.box.wrap(x)),
                    system.radius[:, None],
                    system.mass[:, None],
                    _in_space(v),
                    cluster[:, None],
                ]
            )
            for start in range(0, len(x), _LINES):
                part = columns[start : start + _LINES]
                line = "X" + 8 * " %.10g" + " %d\n"
                out.write((line * len(part)) % tuple(part.ravel()))


def _gsd() -> Any:
    try:
        import gsd.hoomd
    except ImportError:
        raise InputError(
            'path: a .gsd file needs the package gsd: pip install "smolux[spatial]"; '
            "or write an .xyz file, which needs nothing"
        ) from None
    return gsd.hoomd


def _write_gsd(file: Path, result: xr.DataTree, instants: Float) -> None:
    hoomd, system = _gsd(), system_of(result)
    sides, _ = _cell(system)
    middle = np.array(system.box.lengths) / 2  # boxes of GSD have the origin in their middle
    box: Box = system.box
    with hoomd.open(name=str(file), mode="w") as out:
        for step, (time, x, v, cluster) in enumerate(states(result, instants)):
            frame = hoomd.Frame()
            frame.configuration.step = step
            frame.configuration.dimensions = system.dimension
            frame.configuration.box = [*sides, 0, 0, 0]
            particles = frame.particles
            particles.N = len(x)
            particles.types = ["X"]
            particles.position = _in_space(box.wrap(x) - middle).astype(np.float32)
            particles.velocity = _in_space(v).astype(np.float32)
            particles.diameter = (2 * system.radius).astype(np.float32)
            particles.mass = system.mass.astype(np.float32)
            particles.charge = cluster.astype(np.float32)
            frame.log["time"] = np.array([time])
            frame.log["particles/cluster"] = cluster
            out.append(frame)

"""Solves a cell, within a limit of processor time, and says how far off it is."""

from __future__ import annotations

import math
import signal
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

import smolux as sx
from smolux.errors import SmoluxWarning

from . import reference

TOLERANCE = 1e-8
#: below this share of the largest value of a moment there is none
_NOTHING = 1e-30


class TooLongError(Exception):
    """The limit of processor time is reached."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise `TooLongError` after so many seconds of processor time."""

    def stop(*_: Any) -> None:
        raise TooLongError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@dataclass(frozen=True)
class Assessment:
    """What came of a solution.

    Attributes
    ----------
    outcome : str
        "solved", "too long", or the name of the exception.
    errors : dict
        Relative errors by what they are of; infinite if there is no solution.
    remark : str
        Warnings, or the message of the exception.
    """

    outcome: str
    seconds: float
    errors: dict[str, float]
    remark: str = ""
    window: int = 0

    @property
    def worst(self) -> float:
        """The largest of the errors."""
        return max(self.errors.values(), default=math.inf)


def judge(
    model: Any, exact: reference.Solution, times: list[float], limit: float, **options: Any
) -> Assessment:
    """Solve and compare."""
    begun = time.process_time()
    try:
        with warnings.catch_warnings(record=True) as caught, limited(limit):
            warnings.simplefilter("always")
            ds = sx.solve(model, times, **options)
    except TooLongError:
        return Assessment("too long", time.process_time() - begun, {})
    except Exception as error:  # whatever it is, it is the outcome
        seconds = time.process_time() - begun
        return Assessment(type(error).__name__, seconds, {}, str(error).split("\n")[0][:200])
    said = {
        str(w.message).split("\n")[0][:160]: w.category for w in caught
        if issubclass(w.category, (SmoluxWarning, RuntimeWarning))
    }  # fmt: skip
    remark = "; ".join(f"{kind.__name__}: {text}" for text, kind in said.items())
    errors = compare(ds, exact)
    window = int(str(ds.attrs["window"]).strip("[]").split(",")[-1])
    return Assessment("solved", time.process_time() - begun, errors, remark, window)


def compare(ds: Any, exact: reference.Solution) -> dict[str, float]:
    """Return the largest relative errors over the times.

    Of the moments, of the densities as their sum over the number density, of the events of each
    process over all events of the kind that is most frequent, and of the mass in and out over all
    the mass that there was.
    """
    found = ds.isel(replica=0)
    moment = np.asarray(found["moment"])
    # before a pulse there may be exp(-400) of what comes in: that is nothing
    floor = _NOTHING * np.abs(exact.moment).max(axis=0)
    scales = np.maximum(np.abs(exact.moment), floor)
    errors = {f"M{q}": _worst(moment[:, q], exact.moment[:, q], scales[:, q]) for q in range(4)}
    n = np.asarray(found["n"])
    m = min(n.shape[1], exact.window)
    there = scales[:, 0]
    errors["n"] = float(np.max(np.abs(n[:, :m] - exact.n[:, :m]).sum(axis=1) / there))
    events, names = np.asarray(found["events"]), [str(p) for p in found["process"].values]
    most = np.max([np.asarray(e) for e in exact.events.values()], axis=0)
    for k, name in enumerate(names):
        if name in exact.events:
            errors[name] = _worst(events[:, k], exact.events[name], np.maximum(most, floor[0]))
    if "mass_in" in found:
        mass = scales[:, 1] + exact.mass_out
        errors["mass in"] = _worst(np.asarray(found["mass_in"]), exact.mass_in, mass)
        errors["mass out"] = _worst(np.asarray(found["mass_out"]), exact.mass_out, mass)
    return {what: error if np.isfinite(error) else math.inf for what, error in errors.items()}


def _worst(found: Any, exact: Any, scale: Any = None) -> float:
    scale = np.abs(exact) if scale is None else scale
    off = np.abs(np.asarray(found, float) - exact)
    return float(np.max(np.where(off == 0, 0.0, off / np.maximum(scale, 1e-300))))

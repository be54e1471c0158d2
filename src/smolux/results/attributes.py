"""Attributes of results: where they come from, in what netCDF can hold."""

from __future__ import annotations

import datetime
import json
import platform
from collections.abc import Mapping
from importlib import metadata
from typing import Any

import numpy as np

from smolux import __version__

#: raised whenever a name, a dimension or a meaning changes
SCHEMA = 1


def provenance(title: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of a result: where it comes from, and all that is `given` about it."""
    own = {
        "Conventions": "CF-1.11",
        "title": title,
        "source": f"smolux {__version__}",
        "smolux_schema": SCHEMA,
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "platform": platform.platform(),
        "versions": _versions(),
    }
    known = {key: value for key, value in given.items() if value is not None}
    return {key: attribute(value) for key, value in (own | known).items()}


def attribute(value: Any) -> Any:
    """Return what netCDF can hold: a text, a number or numbers; all else becomes JSON text."""
    if isinstance(value, (bool, np.bool_)):
        return int(value)
    if isinstance(value, (int, np.integer)) and not isinstance(value, np.timedelta64):
        # seeds have up to 128 bits
        return int(value) if -(2**63) <= value < 2**63 else str(value)
    if isinstance(value, (float, np.floating)):
        return float(value)
    if (
        isinstance(value, np.ndarray)
        and value.dtype.kind in "iuf"
        and value.ndim == 1 <= value.size
    ):
        return value
    return _text(value)


def _text(value: Any) -> str:
    """Return a text that HDF5 takes: a text as it is, unless it is not valid; else JSON."""
    if isinstance(value, str):
        try:
            if b"\0" not in value.encode():
                return value
        except UnicodeEncodeError:
            pass
    try:
        return json.dumps(value, default=_listed)
    except (TypeError, ValueError):  # keys that are no texts, or something within itself
        return json.dumps(repr(value))


def _listed(value: Any) -> Any:
    """Return what JSON does not know as what it does: numbers of NumPy, else a text."""
    known = isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind not in "mM"
    return value.tolist() if known else str(value)


def _versions() -> dict[str, str]:
    versions = {"smolux": __version__, "python": platform.python_version()}
    for package in ("numpy", "scipy", "numba", "xarray"):
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "unknown"
    return versions

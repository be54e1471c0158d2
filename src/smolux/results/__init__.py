"""Results: the Dataset that every method and solver returns, its warnings, its files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from smolux.runtime.lazy import lazily

# xarray is loaded when there is a result
__getattr__, __dir__ = lazily(
    __name__,
    {
        "SCHEMA": "attributes",
        "VARIABLES": "dataset",
        "load": "files",
        "population": "reading",
        "provenance": "attributes",
        "require": "reading",
        "save": "files",
        "to_csv": "files",
        "to_dataset": "dataset",
        "told": "reading",
        "warnings": "reading",
    },
)

__all__ = [
    "SCHEMA",
    "VARIABLES",
    "load",
    "population",
    "provenance",
    "require",
    "save",
    "to_csv",
    "to_dataset",
    "told",
    "warnings",
]

if TYPE_CHECKING:
    from .attributes import SCHEMA, provenance
    from .dataset import VARIABLES, to_dataset
    from .files import load, save, to_csv
    from .reading import population, require, told, warnings

"""Results: the Dataset that every method and solver returns, its warnings, its files."""

from .attributes import SCHEMA, provenance
from .dataset import VARIABLES, to_dataset
from .files import load, save, to_csv
from .reading import population, require, told, warnings

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

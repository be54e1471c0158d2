"""Packages whose names are loaded when they are used, as SPEC 1 of Scientific Python has it."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def lazily(
    package: str, where: Mapping[str, str | tuple[str, ...]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the functions ``__getattr__`` and ``__dir__`` of a package.

    Parameters
    ----------
    package : str
        Its name.
    where : mapping
        The module of the package that defines each name. One that ends with a dot stands for the
        module, as in ``{"plot": "plotting."}``, and a tuple of names for these, as a registry does.
    """

    def loaded(name: str) -> Any:
        if name not in where:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        place = where[name]
        if isinstance(place, tuple):
            value: Any = tuple(getattr(sys.modules[package], entry) for entry in place)
        else:
            value = importlib.import_module(f"{package}.{place.rstrip('.')}")
            value = value if place.endswith(".") else getattr(value, name)
        setattr(sys.modules[package], name, value)
        return value

    return loaded, lambda: list(sys.modules[package].__all__)

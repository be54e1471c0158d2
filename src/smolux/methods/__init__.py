"""Ways to draw the next event: a folder for each method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from smolux.runtime.lazy import lazily

if TYPE_CHECKING:
    from .acceptance_rejection.method import AcceptanceRejection
    from .base import Method
    from .inverse.method import Inverse
    from .low_rank.method import FictitiousJumps, LowRank
    from .size_class.method import SizeClass

    METHODS: tuple[type[Method], ...]

#: every method by its name, with its module and class; a class is loaded when it is used, for what
#: is compiled loads Numba, and a case that names a method can be read without
NAMES = {
    "size-class": ("size_class.method", "SizeClass"),
    "acceptance-rejection": ("acceptance_rejection.method", "AcceptanceRejection"),
    "inverse": ("inverse.method", "Inverse"),
    "low-rank": ("low_rank.method", "LowRank"),
    "fictitious-jumps": ("low_rank.method", "FictitiousJumps"),
}

__all__ = [
    "METHODS",
    "NAMES",
    "AcceptanceRejection",
    "FictitiousJumps",
    "Inverse",
    "LowRank",
    "Method",
    "SizeClass",
]

__getattr__, __dir__ = lazily(
    __name__,
    {name: module for module, name in NAMES.values()}
    | {"Method": "base", "METHODS": tuple(name for _, name in NAMES.values())},
)

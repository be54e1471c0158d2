"""What travels with a particle beside its size: one file per attribute (an internal coordinate)."""

from .base import Attribute
from .composition import Composition

#: every attribute; the name in a case file is its ``name``
ATTRIBUTES: tuple[type[Attribute], ...] = (Composition,)

__all__ = ["ATTRIBUTES", "Attribute", "Composition"]

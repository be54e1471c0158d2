"""What every attribute has."""

from __future__ import annotations

from typing import ClassVar


class Attribute:
    """Something that a particle carries beside its size, as a row of numbers.

    An attribute is a frozen dataclass of its settings. Merging and breaking particles hand rows on
    by the rule of the attribute; rates may depend on the size alone: it is passive.

    Attributes
    ----------
    name : str
        The name in case files and in the registry `ATTRIBUTES`.
    """

    name: ClassVar[str]

"""What all settings have: their arguments are checked all at once, beside what others found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from smolux.errors import InputError, Problem
from smolux.model import Model

from .kinds import checked


@dataclass(frozen=True)
class Arguments:
    """Arguments of a function, each a field with its kind; see `smolux.settings.kinds`."""

    @classmethod
    def checked(cls, given: Mapping[str, Any], found: Sequence[str] = ()) -> Self:
        """Check arguments, all at once, beside problems that were `found` before.

        Raises
        ------
        InputError
            With every mistake.
        """
        problems = [*found, *cls.mistakes(given)]
        if problems:
            raise InputError(problems)
        return cls(**checked(cls, given)[0])

    @classmethod
    def mistakes(cls, given: Mapping[str, Any]) -> list[str]:
        """Say what is wrong with arguments."""
        good, problems = checked(cls, given)
        return [*problems, *cls.disagreements(good)]

    @classmethod
    def for_model(cls, model: Any, given: Mapping[str, Any], found: Sequence[str] = ()) -> Self:
        """Check a model with the arguments for it, all at once, as `checked` does."""
        if isinstance(model, Model):
            return cls.checked(given, [*found, *cls.against(model, given)])
        wrong = Problem("model", "must be a smolux.Model(kernel=..., ...)", model)
        return cls.checked(given, [*found, wrong])

    @classmethod
    def disagreements(cls, good: Mapping[str, Any]) -> list[str]:
        """Say which arguments do not go together, of those that are right by themselves."""
        return []

    @classmethod
    def against(cls, model: Model, given: Mapping[str, Any]) -> list[str]:
        """Say which arguments do not go with the model."""
        return []

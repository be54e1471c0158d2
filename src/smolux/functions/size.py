"""A number, a formula, a list or a function of the size of a particle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError

from .law import Law

Float = NDArray[np.float64]

#: sizes at which a new function is looked at
_TRIED = (1.0, 2.0, 3.0, 10.0, 100.0, 1000.0)


@dataclass(frozen=True)
class SizeFunction(Law):
    """A function of the size; made by `SizeFunction.of`."""

    @classmethod
    def of(cls, given: Any, what: str, variable: str = "k") -> SizeFunction:
        """Make a function of the size.

        Parameters
        ----------
        given : float, str, callable, sequence of float or SizeFunction
            A number; a formula in the size such as ``"k**(2/3)"``, see `smolux.functions.formula`;
            a plain Python function of one size, whose further arguments have defaults; or the
            values for the sizes 1, 2, ..., of which the last one holds for all larger ones, too.
        what : str
            What it stands for, for messages.
        variable : str
            What the size is called in a formula.

        Raises
        ------
        InputError
            If it is none of these, or negative or not finite at a few sizes.
        """
        if isinstance(given, cls):
            return given
        kinds = (
            f'a number, a formula in {variable} such as "{variable}**(2/3)", a function of the '
            "size, or a list of the values for the sizes 1, 2, ..."
        )
        new = cls.read(given, (variable,), what, kinds, lists=True)
        new._try(what)
        return new

    def _try(self, what: str) -> None:
        where = f"{what} = {self.text}"
        sizes = np.array(_TRIED) if self.values is None else np.arange(1.0, len(self.values) + 1.0)
        try:
            found = self(sizes)
        except Exception as error:  # a user's function may raise anything
            raise InputError(
                f"{where}: raises {type(error).__name__}: {error}; correct the function"
            ) from error
        self._check(sizes, found, (found >= 0.0) & (found < np.inf), f"{where}: ", "zero or more")

    def _check(self, sizes: Float, found: Float, good: Any, where: str, wanted: str) -> None:
        if not good.all():
            k = int(np.argmin(good))
            raise InputError(
                f"{where}is {found[k]:g} for the size {sizes[k]:.0f}; must be a finite number, "
                f"{wanted}"
            )

    def check_positive(self, what: str) -> None:
        """Raise `InputError` if the function is zero at one of a few sizes up to 2**40."""
        sizes = np.unique(np.concatenate((np.arange(1.0, 65.0), 2.0 ** np.arange(41))))
        found = self(sizes)
        good = (found > 0.0) & (found < np.inf)
        self._check(sizes, found, good, f"{what} = {self.text}: ", "above zero")

    def __call__(self, sizes: ArrayLike) -> Float:
        """Evaluate on an array of sizes."""
        return self.on(sizes)

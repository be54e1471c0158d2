"""Which exact law of a finite system there is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import smolux.exact.additive as additive
import smolux.exact.constant as constant
import smolux.exact.multiplicative as multiplicative
from smolux.errors import InputError, did_you_mean
from smolux.exact.find import solution

from .additive import Additive
from .base import FiniteLaw
from .constant import Constant
from .multiplicative import Multiplicative

if TYPE_CHECKING:
    from smolux.model import Model

_LAWS: dict[str, type[FiniteLaw]] = {c.name: c for c in (Constant, Additive, Multiplicative)}
#: of the solution of the rate equations, which a model is known by
_OF = {
    constant.Constant: Constant,
    additive.Additive: Additive,
    multiplicative.Multiplicative: Multiplicative,
}


def law(
    kernel: str, particles: int, *, volume: float | None = None, scale: float = 1.0
) -> FiniteLaw:
    """Return the finite law of a kernel.

    Parameters
    ----------
    kernel : {"constant", "additive", "multiplicative"}
    particles : int
        Monomers at the start.
    volume : float, optional
        As large as `particles` if left out.
    scale : float
        Prefactor of the kernel.
    """
    if kernel not in _LAWS:
        raise InputError(
            f"kernel = {kernel!r}: no finite law is known{did_you_mean(str(kernel), list(_LAWS))}"
        )
    return _LAWS[kernel](particles, volume, scale)


def find(model: Model, particles: int) -> FiniteLaw | None:
    """Find the finite law of a model simulated with a number of particles, in a fixed volume.

    Parameters
    ----------
    model : Model
    particles : int
        At the start; the volume is ``particles / density``.

    Returns
    -------
    FiniteLaw or None
        None if no closed law is known.
    """
    exact = solution(model)
    if exact is None or type(exact) not in _OF:
        return None
    return _OF[type(exact)](particles, particles / exact.density, exact.scale)


def number_mean(
    kernel: str, particles: int, t: float, *, volume: float | None = None, scale: float = 1.0
) -> float:
    """Mean number of clusters at the time `t`; see `law` for the parameters."""
    return law(kernel, particles, volume=volume, scale=scale).number_mean(t)


def number_variance(
    kernel: str, particles: int, t: float, *, volume: float | None = None, scale: float = 1.0
) -> float:
    """Variance of the number of clusters at the time `t`; see `law` for the parameters.

    Each collision takes one cluster away, so this is also the variance of the number of collisions.
    """
    return law(kernel, particles, volume=volume, scale=scale).number_variance(t)

"""Systems to start from: a lattice, random positions; velocities and radii by law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.core.seeds import streams
from smolux.errors import InputError, did_you_mean

from .analysis.overlaps import placed_at_random
from .box import Box
from .system import System

Float = NDArray[np.float64]
Radii = Callable[[np.random.Generator, int], ArrayLike]

#: the share of the box that discs on a square or a cubic lattice can cover
_FULL = {2: np.pi / 4, 3: np.pi / 6}


def lattice(
    discs: int,
    volume_fraction: float = 0.1,
    *,
    dimension: int = 2,
    walls: str | Sequence[str] = "reflecting",
    velocities: str = "unit",
    temperature: float = 1.0,
    seed: int | None = None,
) -> System:
    """Equal discs on a square or a cubic lattice of spacing 1.

    Parameters
    ----------
    discs : int
        A square number, in three dimensions a cube; the sides of the box are its root.
    volume_fraction : float
        Share of the box that the discs cover; below pi/4 or pi/6.
    dimension : {2, 3}
    walls : {"reflecting", "periodic"} or sequence of these
    velocities : {"unit", "maxwellian"}
        Speeds of 1 in random directions, or the law of a gas at a `temperature`.
    temperature : float
        Variance of each component of the velocity of a disc of mass 1.
    seed : int, optional
        Of the velocities; drawn and stored if left out.

    Returns
    -------
    System

    Raises
    ------
    InputError

    References
    ----------
    P. Degond, G. Dimarco, M. Ferreira, S. Hecht, the initial condition of their section 4.
    """
    problems = _common(discs, volume_fraction, dimension, velocities, temperature, seed)
    root = round(discs ** (1 / dimension)) if not problems else 0
    if not problems:
        if root**dimension != discs:
            name = "a square" if dimension == 2 else "a cube"
            near = f"{root**dimension} or {(root + 1) ** dimension}"
            problems.append(f"discs = {discs}: a lattice takes {name} number of them, as {near}")
        if volume_fraction >= _FULL[dimension]:
            problems.append(
                f"volume_fraction = {volume_fraction!r}: on a lattice discs touch at "
                f"{_FULL[dimension]:.4f}; use a smaller one"
            )
    if problems:
        raise InputError(problems)
    axes = np.meshgrid(*[np.arange(root) + 0.5] * dimension, indexing="ij")
    position = np.stack(axes, -1).reshape(discs, dimension)
    radius = np.full(discs, _equal_radius(volume_fraction, dimension))
    generator, entropy = _generator(seed)
    return System(
        position,
        _velocities(velocities, generator, np.ones(discs), dimension, temperature),
        radius,
        box=Box((float(root),) * dimension, walls),
        origin=_origin("lattice", volume_fraction, velocities, temperature, entropy),
    )


def random(
    discs: int,
    volume_fraction: float = 0.1,
    *,
    dimension: int = 2,
    radii: ArrayLike | Radii | None = None,
    walls: str | Sequence[str] = "reflecting",
    velocities: str = "unit",
    temperature: float = 1.0,
    seed: int | None = None,
) -> System:
    """Discs at random, by random sequential addition, one to a unit of area or volume.

    Parameters
    ----------
    discs : int
    volume_fraction : float
        Share of the box that the discs cover. Discs of one size fit up to about 0.5, spheres to 0.35.
    dimension : {2, 3}
    radii : array_like of shape (N,) or callable, optional
        Radii up to a common factor, which the volume fraction sets; or a law such as
        `lognormal_radii` that draws them, called with a NumPy generator and N. Equal if left out.
    walls, velocities, temperature
        As for `lattice`.
    seed : int, optional
        Of positions, radii and velocities; drawn and stored if left out.

    Returns
    -------
    System
        In a square or a cube of the volume N, with masses by size and mean 1.

    Raises
    ------
    InputError
        Also if the discs do not fit.
    """  # noqa: E501
    problems = _common(discs, volume_fraction, dimension, velocities, temperature, seed)
    if problems:
        raise InputError(problems)
    generator, entropy = _generator(seed)
    relative = _relative_radii(radii, generator, discs)
    size = relative**dimension / np.mean(relative**dimension)
    radius = _equal_radius(volume_fraction, dimension) * size ** (1 / dimension)
    box = Box((discs ** (1 / dimension),) * dimension, walls)
    position = placed_at_random(radius, box, "surface", streams(entropy, 0, 1)[0])
    return System(
        position,
        _velocities(velocities, generator, size, dimension, temperature),
        radius,
        box=box,
        origin=_origin("random", volume_fraction, velocities, temperature, entropy),
    )


def lognormal_radii(sigma: float) -> Radii:
    """Radii of a lognormal law.

    Parameters
    ----------
    sigma : float
        Geometric standard deviation, above 1.

    Returns
    -------
    callable
        For `random`.
    """
    if not (np.isfinite(sigma) and sigma > 1):
        raise InputError(f"sigma = {sigma!r}: the geometric standard deviation must exceed 1")
    return lambda generator, n: sigma ** generator.standard_normal(n)


def bimodal_radii(ratio: float, share: float) -> Radii:
    """Radii of two sizes.

    Parameters
    ----------
    ratio : float
        Radius of the large ones over that of the small.
    share : float
        Share of the large ones in the number of discs, 0 to 1.

    Returns
    -------
    callable
        For `random`; the number of large ones is rounded, and which they are is drawn.
    """
    problems = []
    if not (np.isfinite(ratio) and ratio > 0):
        problems.append(f"ratio = {ratio!r}: must be a positive number")
    if not 0 <= share <= 1:
        problems.append(f"share = {share!r}: must lie between 0 and 1")
    if problems:
        raise InputError(problems)

    def draw(generator: np.random.Generator, n: int) -> Float:
        relative = np.ones(n)
        relative[generator.permutation(n)[: round(share * n)]] = ratio
        return relative

    return draw


def _common(
    discs: Any, fraction: Any, dimension: Any, velocities: Any, temperature: Any, seed: Any
) -> list[str]:
    problems = []
    if not isinstance(discs, (int, np.integer)) or isinstance(discs, bool) or discs < 1:
        problems.append(f"discs = {discs!r}: must be a whole number, one or more")
    if dimension not in (2, 3):
        problems.append(f"dimension = {dimension!r}: must be 2 or 3")
    for name, value in (("volume_fraction", fraction), ("temperature", temperature)):
        if not (isinstance(value, (int, float, np.number)) and np.isfinite(value) and value > 0):
            problems.append(f"{name} = {value!r}: must be a positive number")
    if velocities not in ("unit", "maxwellian"):
        near = did_you_mean(str(velocities), ["unit", "maxwellian"])
        problems.append(f"velocities = {velocities!r}: unknown{near}")
    if seed is not None and (not isinstance(seed, (int, np.integer)) or seed < 0):
        problems.append(f"seed = {seed!r}: must be a whole number, zero or more")
    return problems


def _equal_radius(fraction: float, dimension: int) -> float:
    """Radius of discs, one to a unit of volume, that cover a fraction of it."""
    if dimension == 2:
        return float(np.sqrt(fraction / np.pi))
    return float(np.cbrt(0.75 * fraction / np.pi))


def _generator(seed: int | None) -> tuple[np.random.Generator, int]:
    entropy = np.random.SeedSequence(seed).entropy
    assert isinstance(entropy, int)
    return np.random.default_rng(entropy), entropy


def _relative_radii(radii: Any, generator: np.random.Generator, discs: int) -> Float:
    if radii is None:
        return np.ones(discs)
    try:
        drawn = np.asarray(radii(generator, discs) if callable(radii) else radii, float)
    except (TypeError, ValueError):
        drawn = np.empty(0)
    if drawn.shape != (discs,) or not (np.isfinite(drawn).all() and (drawn > 0).all()):
        raise InputError(
            f"radii: must be {discs} positive numbers, or a function of a generator and a number "
            "that gives them, such as smolux.spatial.lognormal_radii(1.3)"
        )
    return drawn


def _velocities(
    law: str, generator: np.random.Generator, mass: Float, dimension: int, temperature: float
) -> Float:
    v = generator.standard_normal((len(mass), dimension))
    if law == "maxwellian":
        return v * np.sqrt(temperature / mass)[:, None]
    if dimension == 2:
        angle = generator.uniform(-np.pi, np.pi, len(mass))
        return np.stack([np.cos(angle), np.sin(angle)], 1)
    return v / np.linalg.norm(v, axis=1)[:, None]


def _origin(
    kind: str, fraction: float, velocities: str, temperature: float, entropy: int
) -> dict[str, Any]:
    law = velocities if velocities == "unit" else f"{velocities}, temperature {temperature:g}"
    return {"initial": kind, "volume_fraction": fraction, "velocities": law, "seed": entropy}

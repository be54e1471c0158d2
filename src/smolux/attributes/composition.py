"""Of how many monomers of which kind a particle consists."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.checks import is_number
from smolux.errors import InputError, Problem

from .base import Attribute

Int = NDArray[np.int64]
Float = NDArray[np.float64]


@dataclass(frozen=True)
class Composition(Attribute):
    """Each particle has whole numbers of monomers of several kinds, which add up to its size.

    A merged particle has those of both. What breaks off has a fair share: of the monomers of the
    pair, or of the particle, each set of that many is as likely as any other, so that the numbers
    of a fragment are multivariate hypergeometric. No monomer changes its kind, and each kind is
    conserved as a whole number.

    Parameters
    ----------
    shares : mapping of str to float
        The kinds and the share of each among all monomers at the start, such as
        ``{"soot": 0.4, "sulphate": 0.6}``. So many of all monomers, to the nearest whole number,
        are of a kind, and which these are is drawn: particles at the start are mixed. Shares are
        divided by their sum.
    by_size : mapping of int to mapping, optional
        Shares of the particles of some sizes at the start in place of these:
        ``{1: {"soot": 1.0}, 8: {"sulphate": 1.0}}``.
    sources : mapping of str to mapping, optional
        Shares of what sources bring in, by the names of the sources in results; those of `shares`
        where nothing is said. Each monomer is of a kind with that chance.

    Raises
    ------
    InputError
        With all that is wrong.
    """

    shares: Mapping[str, float]
    by_size: Mapping[int, Mapping[str, float]] = field(default_factory=dict)
    sources: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    name: ClassVar[str] = "composition"

    def __post_init__(self) -> None:
        problems: list[str] = []
        shares = _checked(("shares",), self.shares, None, problems)
        by_size = {}
        for size, given in _items("by_size", self.by_size, problems):
            whole = isinstance(size, (int, float, np.number, str)) and str(size).strip().isdigit()
            if not whole or int(size) < 1:
                cure = "sizes are whole numbers from 1"
                problems.append(Problem.at(f"by_size: {size!r}: {cure}", "by_size", str(size)))
                continue
            place = ("by_size", str(size))
            by_size[int(size)] = _checked(place, given, shares, problems)
        sources = {
            str(name): _checked(("sources", str(name)), given, shares, problems)
            for name, given in _items("sources", self.sources, problems)
        }
        if problems:
            raise InputError(problems)
        for key, value in (("shares", shares), ("by_size", by_size), ("sources", sources)):
            object.__setattr__(self, key, value)

    def __hash__(self) -> int:
        return hash(repr(self))

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds, in the order of `shares`."""
        return tuple(self.shares)

    def of(self, size: int | None = None, source: str | None = None) -> Float:
        """Return the shares of a size at the start, or of what a source brings in."""
        given = self.shares if source is None else self.sources.get(source, self.shares)
        if size is not None:
            given = self.by_size.get(size, given)
        found = np.array([given.get(kind, 0.0) for kind in self.kinds])
        return found / found.sum()

    def monomers(self, sizes: Int, counts: Int) -> dict[int, Int]:
        """Return how many monomers of each kind there are at the start.

        By the sizes that have shares of their own, and under 0 in all the others together.
        """
        mass = sizes * counts
        own = {int(s): int(m) for s, m in zip(sizes, mass, strict=True) if int(s) in self.by_size}
        found = {size: rounded(self.of(size), total) for size, total in own.items()}
        return {0: rounded(self.of(), int(mass.sum()) - sum(own.values())), **found}


def rounded(shares: Float, total: int) -> Int:
    """Round shares of a whole number to whole numbers that add up to it: the largest remainders."""
    exact = shares * total
    whole = np.floor(exact).astype(np.int64)
    missing = total - int(whole.sum())
    whole[np.argsort(whole - exact, kind="stable")[:missing]] += 1
    return whole


def _items(key: str, given: Any, problems: list[str]) -> list[tuple[Any, Any]]:
    if isinstance(given, Mapping):
        return list(given.items())
    problems.append(Problem(key, "must be a mapping", given))
    return []


def _checked(
    place: tuple[str, ...], given: Any, known: Mapping[str, float] | None, problems: list[str]
) -> dict[str, float]:
    """Return shares as plain numbers; note what is wrong with them."""
    where = ".".join(place)
    if not isinstance(given, Mapping) or not given:
        text = 'must be shares of kinds, such as {"soot": 0.4, "sulphate": 0.6}'
        problems.append(Problem.at(f"{where} = {given!r}: {text}", *place))
        return {}
    found: dict[str, float] = {}
    for kind, share in given.items():
        if not isinstance(kind, str) or not kind.strip():
            problems.append(Problem.at(f"{where}: {kind!r}: a kind is a word", *place))
        elif known is not None and kind not in known:
            text = f"{where}: {kind!r} is no kind of `shares`: give it there, be it with 0"
            problems.append(Problem.at(text, *place))
        elif not (is_number(share) and 0.0 <= share < np.inf):
            text = f"{where}: {kind} = {share!r}: must be a finite number, zero or more"
            problems.append(Problem.at(text, *place, kind))
        else:
            found[kind] = float(share)
    if len(found) == len(given) and not sum(found.values()) > 0.0:
        problems.append(Problem.at(f"{where} = {dict(given)!r}: all are zero", *place))
    if known is None and len(found) == len(given) == 1:
        text = f"{where} = {dict(given)!r}: one kind is all there is: give two or more"
        problems.append(Problem.at(text, *place))
    return found

"""Whether many correlated differences together are more than chance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Rows:
    """Differences, turned so that one row holds what is tested and the others the scatter.

    If nothing differs, all rows are independent with mean zero and the same covariances.

    Attributes
    ----------
    tested : ndarray of shape (m,)
        The differences of the means, in units of the scatter of one row.
    scatter : ndarray of shape (d, m)
        As many rows as there are degrees of freedom.
    """

    tested: Float
    scatter: Float

    @classmethod
    def of_one(cls, values: Float, known: Float, volumes: Float) -> Rows:
        """Compare replicas of shape (R, m) with `known` numbers.

        A replica of twice the volume has half the variance.
        """
        weights = np.sqrt(volumes)
        return cls._turned(weights[:, None] * (values - known), weights[:, None])

    @classmethod
    def of_two(cls, first: Float, second: Float, volumes: tuple[Float, Float]) -> Rows:
        """Compare replicas with other replicas: what is common to all is taken out."""
        weights = np.sqrt(np.concatenate(volumes))
        group = np.repeat([1.0, 0.0], [len(first), len(second)])
        rows = weights[:, None] * np.concatenate([first, second])
        return cls._turned(rows, np.stack([weights, weights * group], axis=1))

    @classmethod
    def _turned(cls, rows: Float, design: Float) -> Rows:
        """Turn rows to where the last column of `design` points, beyond those before it."""
        basis = np.linalg.qr(design, mode="complete")[0]
        turned = basis.T @ rows
        k = design.shape[1]
        return cls(turned[k - 1], turned[k:])

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the scatter."""
        return len(self.scatter)


def score_test(rows: Rows, scale: Float) -> float:
    """Return the probability of a larger score, whatever the correlations; uniform by chance.

    All entries, in units of `scale`, are reduced to one score for each row: the first principal
    component of tested row and scatter together, not centred. A difference that is large beside
    the scatter draws the component to itself. Whichever way a component is found from the sums of
    squares and products of all rows, Student's test of its scores has exactly its nominal level
    for normal entries, however many there are and however few rows (Laeuter, Glimm and Kropf,
    theorem 1 with the weights of their section 3).

    References
    ----------
    J. Laeuter, Biometrics 52, 964 (1996), doi:10.2307/2533057; J. Laeuter, E. Glimm, S. Kropf, Ann.
    Stat. 26, 1972 (1998), doi:10.1214/aos/1024691363.
    """
    scaled = np.vstack([rows.tested, rows.scatter]) / scale
    # the Gram matrix of the rows has the scores as its eigenvectors, and is small
    score = np.linalg.eigh(scaled @ scaled.T)[1][:, -1]
    rest = float(np.sum(score[1:] ** 2))
    if rest <= 0.0:
        return 0.0
    return float(2.0 * stats.t.sf(abs(score[0]) * np.sqrt(rows.freedom / rest), rows.freedom))


def total_test(rows: Rows, scale: Float) -> tuple[float, float, float]:
    """Test the sum of squares, with the scatter of all entries taken together.

    ``F = |tested|**2 / (|scatter|**2 / d)`` for entries in units of `scale` follows an F law with
    f and f d degrees of freedom, where ``f = (tr C)**2 / tr C**2`` for the covariances C. Those of
    the scatter make f too small, so equal laws are rejected less often than p = 0.05 says; in
    trials, up to five times as often at p = 0.001, if few combinations of the entries scatter much
    more than the others. As the scatter of all entries counts, three replicas can tell a large
    difference.

    Returns
    -------
    p, x, f : float
        Probability of a larger F; f F, which is like a chi-square, and f.

    References
    ----------
    A. P. Dempster, Ann. Math. Stat. 29, 995 (1958), doi:10.1214/aoms/1177706437; Z. Bai, H.
    Saranadasa, Statistica Sinica 6, 311 (1996), section 2.
    """
    tested, scatter = rows.tested / scale, rows.scatter / scale
    values = np.maximum(np.linalg.eigvalsh(scatter @ scatter.T), 0.0)
    total = float(values.sum())
    if total <= 0.0:
        return 0.0, np.inf, 1.0
    f = total**2 / float(np.sum(values**2))
    ratio = float(tested @ tested) / (total / rows.freedom)
    return float(stats.f.sf(ratio, f, f * rows.freedom)), f * ratio, f

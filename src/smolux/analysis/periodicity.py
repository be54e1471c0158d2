"""Whether a series has a period, or is the noise of an equilibrium."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

#: values from which a spectrum says anything
_ENOUGH = 16


def chance_of_noise(times: Float, values: Float) -> float:
    """Probability that noise without a period has as high a peak in its spectrum.

    The noise of an equilibrium forgets what it was at an exponential rate, as an autoregressive
    process of order one does, so its spectrum falls with the frequency without a peak. The
    periodogram is divided by the spectrum of such a process that has the variance and the
    correlation of neighbours of the series, the latter corrected for its bias
    ``-(1 + 4 rho) / n``; for noise the ratios are exponential numbers of mean one, of which the
    largest counts. The lowest frequency, of one period in the whole series, is left out.

    Parameters
    ----------
    times, values : ndarray of shape (n,)
        Uneven times are interpolated.

    Returns
    -------
    float
        NaN for fewer than 16 values, or without any scatter.

    References
    ----------
    M. Schulz, M. Mudelsee, Comput. Geosci. 28, 421 (2002), doi:10.1016/S0098-3004(01)00044-9,
    equations 2 to 4; M. G. Kendall, Biometrika 41, 403 (1954), doi:10.1093/biomet/41.3-4.403.
    """
    n = len(values)
    if n < _ENOUGH:
        return np.nan
    even = np.interp(np.linspace(times[0], times[-1], n), times, values)
    x = even - even.mean()
    square = float(x @ x)
    if square <= 0.0:
        return np.nan
    rho = float(x[1:] @ x[:-1]) / square
    rho = min(rho + (1.0 + 4.0 * rho) / n, 1.0 - 1.0 / n)
    k = np.arange(1, n // 2)
    power = np.abs(np.fft.rfft(x)[k]) ** 2
    noise = 1.0 / (1.0 + rho**2 - 2.0 * rho * np.cos(2.0 * np.pi * k / n))
    highest = float(np.max((power / noise)[1:])) * float(noise.sum() / power.sum())
    return float(-np.expm1(len(k) * np.log1p(-np.exp(-highest))))

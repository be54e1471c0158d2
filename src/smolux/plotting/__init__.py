"""Figures of results, ready for a journal: one function for each kind.

Each returns a `matplotlib.figure.Figure`; it needs no display, and `save` writes it to a file.
Most take ``ax=`` to draw into axes of your own.
"""

from .clusters import clusters
from .comparison import comparison
from .distribution import size_distribution
from .efficiency import efficiency
from .mean_field import mean_field
from .morphology import dimension, pair_distribution
from .movie import movie
from .oscillation import oscillations
from .scaling import scaling
from .series import moments, time_series
from .spatial import coarsening, discs
from .spatial_kernel import spatial_kernel
from .style import PALETTE, save

__all__ = [
    "PALETTE",
    "clusters",
    "coarsening",
    "comparison",
    "dimension",
    "discs",
    "efficiency",
    "mean_field",
    "moments",
    "movie",
    "oscillations",
    "pair_distribution",
    "save",
    "scaling",
    "size_distribution",
    "spatial_kernel",
    "time_series",
]

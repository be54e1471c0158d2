"""What results say: means and intervals, agreement, oscillations, gelation, scaling."""

from .balance import mass_balance
from .by_rates import densities_by_rates
from .compare import compare, verdict
from .gelation import gel_fraction, gelation
from .moments import moments
from .oscillations import extrema, oscillations
from .reference import exact_dataset, model_of
from .scaling import mean_size, scaling
from .select import series
from .summary import summary
from .sweeps import format_sweep, sweep_table
from .table import format_table, tables

__all__ = [
    "compare",
    "densities_by_rates",
    "exact_dataset",
    "extrema",
    "format_sweep",
    "format_table",
    "gel_fraction",
    "gelation",
    "mass_balance",
    "mean_size",
    "model_of",
    "moments",
    "oscillations",
    "scaling",
    "series",
    "summary",
    "sweep_table",
    "tables",
    "verdict",
]

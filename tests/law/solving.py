"""How tests of the solver solve: within a limit of time, and without warnings."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from verification.solver import judge
from verification.solver.axes import KERNELS, PROCESSES, STARTS, VARYING
from verification.solver.cells import Cell

import smolux as sx

P, I = sx.processes, sx.initial  # noqa: E741
K1 = sx.kernels.Constant()
AGGREGATION = P.Aggregation()
#: what a solution at the default tolerance of 1e-8 may be off
CLOSE = 1e-7
#: seconds of processor time after which a solution is taken never to end
PATIENCE = 60.0
slow = pytest.mark.slow


def solved(model, times, **options):
    """Solve within a limit of time and without a warning, of NumPy's neither."""
    with judge.limited(PATIENCE), warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        return sx.solve(model, times, **options)


def number(ds):
    return ds["number_density"].values[0]


def moment(ds, order):
    return ds["moment"].sel(order=order).values[0]


def with_(*processes, kernel=K1, initial=None):
    initial = I.monodisperse() if initial is None else initial
    return sx.Model(kernel, [AGGREGATION, *processes], initial=initial)


def cell(start, kernel, *processes, varying="none"):
    named = [{x.name: x for x in axis} for axis in (STARTS, KERNELS, PROCESSES, VARYING)]
    chosen = tuple(named[2][p] for p in processes)
    return Cell(named[0][start], named[1][kernel], chosen, named[3][varying])

"""The deterministic solver against a reference that shares no code with it: a matrix of models."""

from __future__ import annotations

from verification.suite import Suite

from .matrix import ITEMS

SUITE = Suite(
    name="solver",
    title="Verification: the rate equations",
    paper=(
        "`smolux.solve` against closed forms, and against plain sums on a generous fixed window "
        "integrated by SciPy's DOP853 at a relative tolerance of 1e-11."
    ),
    items=ITEMS,
    remarks=(
        "A cell is a start, a kernel, processes beside aggregation and what varies in time. The "
        "time is such that a typical particle meets its like about once, monomers more often.",
        "The reference is written from the equations alone. It integrates what passes the edge of "
        "its window, and takes a wider one until that is below 3e-11 of each moment up to M3.",
        "What varies has the mean one over the time: a ramp 2 t / T, a pulse of width T / 333, a "
        "box from 0.42 T to 0.78 T, and half sines with a period of T / 6.",
    ),
)

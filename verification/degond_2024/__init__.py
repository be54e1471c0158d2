"""Ballistic aggregation of discs, by events and by time steps: Degond et al. (2024)."""

from __future__ import annotations

from verification.suite import Suite

from . import (
    boxes,
    controls,
    exactness,
    figure7,
    figure11,
    final_time,
    large,
    pairs,
    run_time,
    shape,
    short_steps,
)

SUITE = Suite(
    name="degond_2024",
    title="Verification: Degond et al. (2024)",
    paper=(
        "P. Degond, G. Dimarco, M. Ferreira, S. Hecht, *Studying ballistic aggregation phenomena "
        "through efficient Time Stepping approaches*."
    ),
    items=(
        figure7.ITEM,
        pairs.ITEMS[0],
        controls.ITEM,
        boxes.ITEMS[0],
        figure11.ITEM,
        *shape.ITEMS,
        pairs.ITEMS[1],
        *boxes.ITEMS[1:],
        final_time.ITEM,
        short_steps.ITEM,
        exactness.ITEM,
        run_time.ITEM,
        large.ITEM,
    ),
    remarks=(
        "The formulas and most numbers of the paper are not legible in the text that we have: its "
        "volume fractions, its time steps and the values in its figures. The formulas used here "
        "are derived in [the theory](../theory/ballistic.md), fractions are 0.05 to 0.5, steps 0.5 "
        "to 0.05 radii. What the paper says in words is checked as such; numbers are compared with "
        "those of an independent, exact program.",
        "Figures 7, 8, 10, 11 and 13 to 17 and the time to the final cluster are of the same runs; "
        "their processor time is booked to the first of them that is computed.",
        "Time steps in these figures begin new links without a multiplier, as the paper does; what "
        "smolux does unless told otherwise is in the item on short steps.",
        "Deviations are given in standard errors, those of few runs converted from Student's law "
        "to the normal one. The largest of a few dozen may reach 3 by chance; the limit is 4.5.",
        "The paper's three contacts of six are not found: exact sticking makes a tree, with two of "
        "six. It is a matter of what is counted, see Figure 7.",
    ),
)

"""Aggregation with shattering, by two Monte Carlo methods and a solver: Kalinov et al. (2021)."""

from __future__ import annotations

from verification.suite import Suite

from . import extinction, figure1, hopf, oscillations, ramp, run_time, table1, table2

SUITE = Suite(
    name="kalinov_2021",
    title="Verification: Kalinov et al. (2021)",
    paper=(
        "A. Kalinov, A. I. Osinskiy, S. A. Matveev, W. Otieno, N. V. Brilliantov, *Direct "
        "simulation "
        "Monte Carlo for new regimes in aggregation-fragmentation kinetics* (2021)."
    ),
    items=(
        table1.ITEM,
        table2.ITEM,
        *run_time.ITEMS,
        figure1.ITEM,
        *oscillations.ITEMS,
        extinction.ITEM,
        ramp.ITEM,
        hopf.ITEM,
    ),
    remarks=(
        "The gain of monomers by shattering of sizes from 2 on is printed without a factor 1/2 "
        "in the "
        "rate equations (4); with it, mass is conserved, and the models here have it.",
        "The paper advances time by mean waiting times, this package by exponential ones, as the "
        "jump "
        "process has them. Means agree; the scatter of a run is larger here at early times.",
        "Tables 1 and 2 need the doubling of the volume, Figure 3(a) needs it left out.",
        "Deviations are given in standard errors; those of few runs are converted from Student's "
        "law to the normal one. The largest of a few dozen may reach 3 by chance, so limits are "
        "3.5 to 4.5.",
        "The deviations printed in Table 2 are of an unknown number of runs and are judged with "
        "the scatter of few runs: two of 33 differ from ours by more than half.",
        "Run times are judged by ratios within one run. Seconds stand beside the paper's, but are "
        "on other hardware: acceptance-rejection with the constant kernel takes more of them here.",
        "The oscillations are of few runs and smaller systems than a steady line would need: runs "
        "drift out of phase, and only early times, periods and swings are compared.",
    ),
)

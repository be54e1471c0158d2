"""Weight algorithms, their variance, bias and efficiency: Kolodko and Sabelfeld (2003)."""

from __future__ import annotations

from verification.suite import Suite

from . import bands, choice, cost, efficiency, evaporation, tables2

SUITE = Suite(
    name="kolodko_sabelfeld_2003",
    title="Verification: Kolodko and Sabelfeld (2003)",
    paper=(
        "A. Kolodko, K. Sabelfeld, *Stochastic particle methods for Smoluchowski coagulation "
        "equation: variance reduction and error estimations*, WIAS Preprint 842 (2003)."
    ),
    items=(
        tables2.ITEM,
        *cost.ITEMS,
        *efficiency.ITEMS,
        *bands.ITEMS,
        *evaporation.ITEMS,
        choice.ITEM,
    ),
    remarks=(
        "MMF, the method of majorant frequencies, is direct simulation by acceptance-rejection; "
        "MFA is the mass-flow algorithm; WA is the weight algorithm with w = l^q.",
        "The columns Er of Tables 4.3 to 4.13 and Table 2.2 are not the bias of direct simulation, "
        "which is known exactly: some are 16 times as large, some smaller. Compared are the exact "
        "bias, the statistical errors St, the laws in 1/N and the order of the algorithms.",
        "The time step and W_max that are printed for the weight algorithm are wrong, see the "
        "errata; with them the means are wrong, so the means here cannot be those of the paper.",
        "N is the paper's throughout. The number of samples M is smaller where a smaller one will "
        "do: St is given for the paper's M.",
        "Seconds stand beside the paper's, but are on other hardware: ratios within one run are "
        "compared.",
        "Misprints that are corrected in the targets: Table 4.1, one entry, and Table 4.2, three "
        "entries, are off by a factor of 10; in Table 4.7 the time of MFA does not fit its "
        "product. Conclusion: the concentration falls *by* 90 %, not to 90 %.",
    ),
)

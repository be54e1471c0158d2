"""Cost per sample and efficiency of weightings at equal N, after Kolodko and Sabelfeld (2003).

Direct simulation is acceptance-rejection, with doubling their MMF. Their mass-flow and weight
algorithms take 4 to 200 times as long for a sample, as weighting and acceptance-rejection come
together there. All that is compared is run in turn, batch by batch.

The speed of the replica engine is that of small systems, all included: seeds, initial populations,
events, statistics.
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import smolux as sx
from benchmarks.common import table, write_section

AR = "acceptance-rejection"
HALF = sx.weighting.WeightFunction(0.5)
#: what becomes of few particles, and what is compared then; mass flow keeps their number
RUNS: tuple[tuple[str, Any], ...] = (
    (
        "doubling",
        (
            (AR, "number"),
            ("size-class", "mass-flow"),
            ("low-rank", "mass-flow"),
            ("size-class", HALF),
        ),
    ),
    ("none", ((AR, "number"), ("size-class", "mass-flow"))),
)
#: kernel, density, its size and time: those of the goals
CASES: tuple[tuple[str, Any, str, float], ...] = (
    ("constant", sx.kernels.Constant(), "n_50", 20.0),
    ("additive", sx.kernels.Additive(0.5), "n_70", 3.0),
)
#: particles and replicas
SIZES = ((1024, 2000), (8192, 300))


def _cell(ds: Any, name: str) -> str:
    value, low, high = (float(ds[name + end]) for end in ("", "_lower", "_upper"))
    return f"{value:.3g} ({low:.3g} to {high:.3g})"


def _row(ds: Any, k: int, observable: str) -> list[str]:
    here, first = ds.isel(scheme=k), ds.isel(scheme=0)
    density, base = here.sel(observable=observable), first.sel(observable=observable)
    return [
        str(here["scheme"].values),
        f"{1e6 * float(here['cost']):.3g}",
        f"{float(here['cost'] / first['cost']):.2f}",
        f"{1e9 * float(here['cost'] / here['collisions']):.0f}",
        f"{float(base['variance'] / density['variance']):.3g}",
        _cell(density, "ratio"),
        _cell(here.sel(observable="M2"), "ratio"),
    ]


def efficiencies(sizes: Any) -> list[str]:
    """Measure costs and efficiencies."""
    rows = []
    for (name, kernel, observable, time), (particles, replicas) in product(CASES, sizes):
        for population, schemes in RUNS:
            ds = sx.efficiency(
                sx.Model(kernel=kernel), observables=[observable, "M2"], times=[time],
                schemes=schemes, particles=particles, replicas=replicas, seed=1, threads=1,
                population=population,
            ).isel(time=0)  # fmt: skip
            case = [f"{name}, {observable}({time:g})", f"{particles:,}", population]
            for k in range(ds.sizes["scheme"]):
                rows.append([*case, *_row(ds, k, observable)])
                print(*rows[-1], sep="  ", flush=True)
    header = (
        "case", "N", "population", "scheme", "cost µs", "/ first", "ns a collision",
        "variance, first /", "efficiency / first", "the same for M2",
    )  # fmt: skip
    return table(header, rows)


def speed() -> list[str]:
    """Measure collisions a second of the replica engine, on one core."""
    rows = []
    for name, kernel, _, _ in CASES:
        for particles in (24, 100, 1000):
            ds = sx.ensemble(
                sx.Model(kernel=kernel), [100.0], ["number_density", "M2"], method=AR,
                population="none", particles=particles, replicas=4_000_000 // particles, seed=1,
                threads=1,
            )  # fmt: skip
            rows.append(
                [
                    name, str(particles), f"{ds.attrs['replicas']:,}",
                    f"{ds.attrs['collisions_per_second']:.3g}", f"{1e6 * float(ds['cost']):.3g}",
                ]
            )  # fmt: skip
            print(*rows[-1], sep="  ", flush=True)
    return table(("kernel", "N", "replicas", "collisions / s", "µs a replica"), rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="only the smallest N")
    options = parser.parse_args()
    lines = [
        "The replica engine, one core, all included, until one cluster is left "
        "(acceptance-rejection; goal: 10^7 a second at N = 100):",
        "",
        *speed(),
        "",
        "Cost of a sample, variance and efficiency at equal N, against direct simulation by "
        "acceptance-rejection, with doubling (the MMF of the paper) and without; "
        "95 % intervals (goals: cost at most 2 times, efficiency at least 25 times):",
        "",
        *efficiencies(SIZES[:1] if options.small else SIZES),
        "",
        "Collisions bound what can be reached. Up to these times mass flow has 4.8 (constant) and "
        "5.0 (additive) collisions for each particle, direct simulation with doubling 1.8 and 1.1, "
        "so that a sample costs 2.7 and 4.5 times as much where a collision costs the same. A "
        "density of size k rests on k times as many particles, its variance is about k times "
        "smaller, and with doubling that advantage shrinks by the 8 or 4 copies of the volume.",
    ]
    write_section(
        "kolodko-2003", "Weightings and small systems (Kolodko and Sabelfeld 2003)", lines
    )

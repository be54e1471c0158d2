"""Closed forms against tabulated values, each of which was checked with an independent solver."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from smolux import exact

DATA = Path(__file__).parent / "data" / "exact_spot_values.csv"


def _solution(case: str, params: str) -> exact.Solution:
    law = case.split()[0]
    if law == "E1":
        return exact.Constant()
    if law == "E2":
        return exact.Additive(scale=0.5)
    if law in ("E3", "E3F"):
        return exact.Multiplicative()
    if law == "E3S":
        return exact.Multiplicative(gel="inert")
    if law == "E4":
        a, b = re.findall(r"[AB]=([\d.]+)", params)
        return exact.Bilinear(A=float(a), B=float(b))
    lam = float(params.removeprefix("lam="))
    if law in ("E5", "E5ss"):
        return exact.ConstantShattering(lam=lam)
    return exact.MultiplicativeShattering(lam=lam)


ROWS = [
    pytest.param(row, id=f"{row['case'].split()[0]}-{row['params']}-{row['t']}-{row['observable']}")
    for row in csv.DictReader(DATA.open())
    if not row["observable"].startswith("res")
]


@pytest.mark.parametrize("row", ROWS)
def test_tabulated(row: dict[str, str]) -> None:
    solution = _solution(row["case"], row["params"])
    t, what = float(row["t"]), row["observable"]
    if what.startswith("n_"):
        value = solution.densities(t, int(what[2:]))
    else:
        value = solution.moment(t, 1 if what == "M1sol" else int(what[1:]))
    if row["case"].startswith("E5 ") and what.startswith("n_"):
        # The column "exact" lost digits to its contour; the rate equations are better.
        assert float(value) == pytest.approx(float(row["ode"]), rel=2e-10)
    else:
        assert float(value) == pytest.approx(float(row["exact"]), rel=1e-12)


# Hypergeometric functions of 40 digits, the contour integral by the trapezoidal rule.
@pytest.mark.parametrize(
    ("lam", "t", "k", "density"),
    [
        (1e-3, 100, 2, 0.00039182629889081614),
        (1e-3, 100, 40, 0.0001776173914837219),
        (1e-3, 100, 100, 5.4077685097444058e-5),
        (10, 1, 2, 0.039444484295902012),
        (10, 1, 40, 1.8687574487044764e-34),
        (1e-6, 10, 2, 0.023148149690389622),
        (1e-6, 10, 40, 2.2679185180138901e-5),
        (0.1, 100, 2, 0.022537573220799098),
        (0.1, 100, 5, 0.0048034721750097252),
        (0.1, 100, 20, 0.00046437806786653742),
        (0.1, 10, 100, 1.4522781760938495e-10),
        (1000, 1e-4, 2, 4.7574348836157361e-5),
        (1000, 1e-4, 10, 1.6264812600509757e-39),
    ],
)
def test_shattering_to_all_digits(lam: float, t: float, k: int, density: float) -> None:
    value = exact.ConstantShattering(lam=lam).densities(t, k)
    assert float(value) == pytest.approx(density, rel=1e-13)


def test_named_values() -> None:
    assert exact.Constant().densities([8.0, 20.0], [2, 50]) == pytest.approx(
        np.array([[0.032, 7.13623846352982e-07], [0.0075131480090157776, 7.74413752682e-5]]),
        rel=1e-11,
    )
    assert float(exact.Additive(scale=0.5).densities(3.0, 70)) == pytest.approx(
        2.50396417276e-5, rel=1e-11
    )
    assert float(exact.Additive(scale=0.5).moment(3.0, 3)) == pytest.approx(1030.252118, rel=1e-9)
    assert float(exact.Multiplicative().densities(0.8, 10)) == pytest.approx(
        1.2407691729e-3, rel=1e-10
    )
    flory = exact.Multiplicative()
    assert flory.moment([1.5, 2.0], 1) == pytest.approx([0.417188356134, 0.203187869980], rel=1e-11)
    assert float(flory.moment(1.5, 0)) == pytest.approx(0.286653762764, rel=1e-11)
    shatter = exact.ConstantShattering(lam=0.1)
    assert shatter.moment([1, 10, 100], 0) == pytest.approx(
        [0.677592663234, 0.240349788114, 0.166672972451], rel=1e-11
    )
    assert shatter.densities([1, 10], [1, 2, 5]) == pytest.approx(
        np.array(
            [
                [0.461671703598690, 0.144612241543356, 0.00521119080681],
                [0.101557407656586, 0.0292302299435993, 0.0129658779165],
            ]
        ),
        rel=1e-11,
    )
    assert shatter.collisions([10, 100]) == pytest.approx([1.0669329668, 2.5653961362], rel=1e-10)

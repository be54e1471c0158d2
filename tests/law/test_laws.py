"""Every method obeys every law."""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import laws
import numpy as np
import pytest

import smolux as sx
from shared import EVERY, VARYING, extinction
from shared import QUICK as QUICK_METHODS

pytestmark = extinction

DATA = Path(__file__).parent.parent / "reference" / "data"
METHODS = [method.name for method in sx.methods.METHODS]

#: the others say the same again, and `test_registry` what merges alone
QUICK = ("ballistic", 0.1)

every_method = pytest.mark.parametrize("method", METHODS)
every_but_fictitious = pytest.mark.parametrize("method", EVERY)
#: what `test_registry` holds every method to from other starts
by_one_method = pytest.mark.parametrize(
    "method",
    [pytest.param(m, marks=() if m == QUICK_METHODS[1] else pytest.mark.slow) for m in METHODS],
)


@pytest.mark.parametrize(
    ("law", "shattering"),
    [
        pytest.param(law, x, marks=() if (law, x) == QUICK else pytest.mark.slow)
        for law in laws.LAWS
        for x in (0.0, 0.1)
    ],
)
@every_method
def test_whole_distribution(method: str, law: str, shattering: float) -> None:
    laws.whole_distribution(method, law, shattering)


@pytest.mark.parametrize(
    "method",
    [pytest.param(m, marks=() if m in QUICK_METHODS else pytest.mark.slow) for m in METHODS],
)
def test_distribution_with_a_rate_that_depends_on_time(method: str) -> None:
    """Thinning is the loop's; what the methods know of time is when a draw begins."""
    laws.distribution_in_time(method, VARYING, lambda t: 0.4 * (1 + np.sin(5 * t)))


@by_one_method
def test_aggregation_at_a_rate_that_depends_on_time(method: str) -> None:
    laws.aggregation_in_time(method)


@by_one_method
def test_waiting_times(method: str) -> None:
    laws.waiting_times(method)


@by_one_method
def test_first_collision(method: str) -> None:
    laws.first_collision(method)


@pytest.mark.parametrize("law", [pytest.param("constant", marks=pytest.mark.slow), "additive"])
@every_but_fictitious
def test_fluctuations(method: str, law: str) -> None:
    laws.fluctuations(method, law)


@pytest.mark.parametrize(
    ("law", "times"),
    [("constant", [1, 10]), ("additive", [0.5, 1.5]), ("bilinear", [0.2, 0.5])],
)
@every_method
def test_aggregation(method: str, law: str, times: list[float]) -> None:
    laws.aggregation(method, law, times)


@every_method
def test_shattering(method: str) -> None:
    laws.shattering(method)


@every_but_fictitious
def test_ballistic_with_shattering(method: str) -> None:
    reference: dict[float, dict[int, float]] = defaultdict(dict)
    for row in csv.DictReader((DATA / "ballistic_shatter_lam0.01_moments.csv").open()):
        reference[float(row["t"])] = {k: float(row[f"M{k}"]) for k in (0, 2, 3)}
    ds = laws.against(method, {t: reference[t] for t in (1.0, 10.0)})
    for row in csv.DictReader((DATA / "ballistic_shatter_lam0.01_nk.csv").open()):
        size = int(row["k"])
        if size in (1, 2, 5, 20):
            laws.agree(ds["n"].sel(size=size), [float(row[f"n_k(t={t})"]) for t in (1, 10)], size)


@every_but_fictitious
def test_gelation(method: str) -> None:
    laws.gelation(method)


@pytest.mark.parametrize("population", ["doubling", "fixed-volume"])
@pytest.mark.parametrize("law", ["additive", "ballistic"])
@every_method
def test_mass(method: str, law: str, population: str) -> None:
    laws.mass(method, law, population)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["additive", "ballistic"])
def test_methods_agree(law: str) -> None:
    laws.agreement(METHODS, law)


# what are large particles for few buckets are counted by size for many
FEW = sx.methods.Inverse(buckets=4)


def test_few_buckets() -> None:
    laws.whole_distribution(FEW, "ballistic", 0.1)
    laws.mass(FEW, "ballistic", "doubling")


@pytest.mark.slow
def test_few_buckets_agree_with_many() -> None:
    laws.agreement([FEW, sx.methods.Inverse()], "ballistic")

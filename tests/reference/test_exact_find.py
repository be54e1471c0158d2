"""Which model has which exact solution."""

from __future__ import annotations

import pytest

import smolux as sx
from smolux import exact
from smolux.exact.find import coefficients
from smolux.kernels import Additive, Ballistic, Bilinear, Constant, Multiplicative

Shattering, Aggregation = sx.processes.Shattering, sx.processes.Aggregation


@pytest.mark.parametrize(
    ("kernel", "expected"),
    [
        (Constant(), exact.Constant()),
        (Constant(2.5), exact.Constant(scale=2.5)),
        (Additive(0.3), exact.Additive(scale=0.3)),
        (Multiplicative(4.0), exact.Multiplicative(scale=4.0)),
        (Bilinear(A=0, B=0, scale=3.0), exact.Constant(scale=3.0)),
        (Ballistic(), None),
        (sx.kernels.from_function(lambda i, j: i + j), None),
    ],
)
def test_aggregation(kernel: sx.kernels.Kernel, expected: exact.Solution | None) -> None:
    assert exact.solution(sx.Model(kernel)) == expected


def test_bilinear() -> None:
    kernel = Bilinear(A=0.3, B=0.2, scale=1e-9)
    found = exact.solution(sx.Model(kernel, initial=sx.initial.monodisperse(5.0)))
    assert isinstance(found, exact.Bilinear)
    assert found.density == 5.0
    assert (found.scale, found.A, found.B) == pytest.approx((1e-9, 0.3, 0.2), rel=1e-13)
    assert found.gel_time == pytest.approx(kernel.gel_time() / 5, rel=1e-13)


@pytest.mark.parametrize(
    "kernel", [Constant(), Additive(), Multiplicative(), Bilinear(A=0.5, B=0.1)]
)
def test_every_kernel_that_claims_a_solution_has_one(kernel: sx.kernels.Kernel) -> None:
    assert kernel.exact is not None
    found = exact.solution(sx.Model(kernel))
    assert found is not None
    gel_time = kernel.gel_time()
    assert found.gel_time == pytest.approx(float("inf") if gel_time is None else gel_time)


def test_shattering() -> None:
    def find(kernel: sx.kernels.Kernel, rate: object) -> exact.Solution | None:
        return exact.solution(sx.Model(kernel, [Aggregation(), Shattering(rate)]))

    assert find(Constant(2.0), 0.1) == exact.ConstantShattering(scale=2.0, lam=0.1)
    assert find(Constant(), 0.0) == exact.Constant()
    assert find(Multiplicative(2.0), 0.1) == exact.MultiplicativeShattering(scale=2.0, lam=0.1)
    assert find(Additive(), 0.1) is None
    assert find(Bilinear(A=0.3, B=0.2), 0.1) is None
    assert find(Constant(), lambda t: 0.1 + 0 * t) is None
    assert find(Constant(), 1e4) is None
    assert exact.solution(sx.Model(Constant(), [Shattering(0.1)])) is None


def test_initial_conditions() -> None:
    def find(initial: sx.initial.Initial) -> exact.Solution | None:
        return exact.solution(sx.Model(Constant(), initial=initial))

    assert find(sx.initial.monodisperse(3.0)) == exact.Constant(density=3.0)
    assert find(sx.initial.from_sizes({1: 2.0, 5: 0.0})) == exact.Constant(density=2.0)
    assert find(sx.initial.monodisperse(3.0, size=2)) is None
    assert find(sx.initial.from_sizes({1: 0.5, 2: 0.5})) is None
    assert find(sx.initial.exponential(2.0)) is None


def test_gel_option() -> None:
    model = sx.Model(Multiplicative())
    assert exact.solution(model, gel="inert") == exact.Multiplicative(gel="inert")


def test_a_kernel_that_does_not_follow_its_claim_is_not_believed() -> None:
    class Odd(Constant):
        def __call__(self, i, j):  # type: ignore[no-untyped-def]
            value = super().__call__(i, j)
            return value + 0.1 * (value * i * j > 1e6)

    assert coefficients(Constant()) == (1.0, 0.0, 0.0)
    assert coefficients(Odd()) is None


def test_finite_laws() -> None:
    initial = sx.initial.monodisperse(4.0)
    law = exact.finite.find(sx.Model(Additive(0.5), initial=initial), 100)
    assert law == exact.finite.Additive(100, volume=25.0, scale=0.5)
    assert exact.finite.find(sx.Model(Bilinear(A=0.3, B=0.2)), 100) is None
    assert exact.finite.find(sx.Model(Ballistic()), 100) is None
    shattering = sx.Model(Constant(), [Aggregation(), Shattering(0.1)])
    assert exact.finite.find(shattering, 100) is None

"""The measured kernel against kinetic theory, and its bookkeeping against a plain loop."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import smolux as sx
import smolux.spatial as sp
from smolux import plotting
from smolux.plotting.spatial_kernel import _APART
from smolux.spatial.analysis.kernel import _dataset


@pytest.fixture(scope="module")
def gas():
    """A dilute gas in a periodic box, until a twentieth of it has merged."""
    s = sp.random(20_000, 0.005, velocities="maxwellian", walls="periodic", seed=3)
    return sp.simulate(s, clusters=19_000)


def test_kinetic_theory_of_a_dilute_gas(gas):
    kernel = sp.measured_kernel(gas)
    diameter = 2 * gas["radius"].values[0]
    # 2 diameters wide, times the mean of a relative speed whose components have the variance 2
    expected = 2 * diameter * np.sqrt(np.pi)
    assert float(kernel["kernel"][0, 0]) == pytest.approx(
        expected, abs=4 * float(kernel["error"][0, 0])
    )
    assert float(kernel["error"][0, 0]) < 0.05 * expected
    assert kernel.attrs["scale"] * 2**1.5 == pytest.approx(expected, rel=0.15)


def test_every_merge_is_counted_with_its_exposure():
    """In a box twice as wide as a lattice has it: the density is 1/4."""
    s = sp.lattice(225, 0.2, seed=6)
    result = sp.simulate(sp.System(2 * s.position, s.velocity, 2 * s.radius, box=30))
    start, stop = 2.0, 40.0
    kernel = sp.measured_kernel(result, start, stop)
    events = result["events"].to_dataset()
    time = events["time"].values
    assert np.triu(kernel["collisions"].values).sum() == ((time >= start) & (time < stop)).sum()
    np.testing.assert_array_equal(kernel["collisions"], kernel["collisions"].T)
    # the exposure of clusters of one disc, and of those with clusters of two or three
    ones, twos = np.full(len(time) + 1, 225), np.zeros(len(time) + 1, int)
    for m, sizes in enumerate(events["sizes"].values):
        after = sizes.sum()
        ones[m + 1] = ones[m] - (sizes == 1).sum()
        twos[m + 1] = twos[m] - np.isin(sizes, (2, 3)).sum() + (after in (2, 3))
    step = np.diff(np.clip(np.concatenate([[0], time, [np.inf]]), start, stop))
    single = (ones * (ones - 1) / 2 * step).sum() / 900
    assert float(kernel["exposure"][0, 0]) == pytest.approx(single)
    assert float(kernel["exposure"][0, 1]) == pytest.approx((ones * twos * step).sum() / 900)
    assert float(kernel["exposure"][1, 0]) == float(kernel["exposure"][0, 1])
    assert sp.mean_field_model(kernel).initial.total == 0.25


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_kernel_that_is_known_is_found_again(dimension):
    """Collisions drawn from the law itself give its parameters back, and a chi2 of 1."""
    size = 2.0 ** np.arange(8)
    i, j = size[:, None], size[None, :]
    law = 0.7 * (i**0.625 + j**0.625) ** (dimension - 1) * np.sqrt(1 / i + 1 / j)
    exposure, rng = 3000 / law, np.random.default_rng(5)

    def measured():
        drawn = rng.poisson(exposure * law)
        drawn = np.triu(drawn) + np.triu(drawn, 1).T
        return _dataset(size, drawn.astype(float), exposure, dimension, None, {"density": 0.3})

    kernel = measured()
    found = kernel.attrs
    for name, true in (("scale", 0.7), ("fractal_dimension", 1.6)):
        assert found[name] == pytest.approx(true, abs=4 * found[f"{name}_error"])
        assert found[f"{name}_error"] < 0.05 * true
    # chi2 / f of f = 34 has the variance 2 / f
    assert found["chi2"] == pytest.approx(1, abs=4 * np.sqrt(2 / found["freedoms"]))
    # the error is what the dimension scatters by; of 30 trials to 13 %
    again = [measured().attrs["fractal_dimension"] for _ in range(30)]
    scatter = float(np.std(again, ddof=1))
    assert scatter == pytest.approx(found["fractal_dimension_error"], rel=4 * 0.13)
    # in the figure, lines are the law, of partners so many bins apart
    curves = [a for a in plotting.spatial_kernel(kernel).axes[0].lines if a.get_linestyle() == "-"]
    for curve, apart in zip(curves, _APART, strict=True):
        np.testing.assert_array_equal(curve.get_xdata(), size[apart:])
        np.testing.assert_allclose(
            curve.get_ydata(), np.diag(kernel["mean_field"].values, -apart), rtol=1e-12
        )
    # the same law in the well-mixed model
    model, p = sp.mean_field_model(kernel), 1 / found["fractal_dimension"]
    expected = found["scale"] * (4**p + 9**p) ** (dimension - 1) * np.sqrt(1 / 4 + 1 / 9)
    assert float(model.kernel(4.0, 9.0)) == pytest.approx(expected)
    assert model.initial.total == 0.3


def test_the_well_mixed_model(gas):
    kernel = sp.measured_kernel(gas, fractal_dimension=1.5)
    assert kernel.attrs["fractal_dimension"] == 1.5
    model = sp.mean_field_model(kernel)
    law = model.kernel(4.0, 9.0)
    c = kernel.attrs["scale"]
    assert float(law) == pytest.approx(c * (4 ** (2 / 3) + 9 ** (2 / 3)) * np.sqrt(1 / 4 + 1 / 9))
    assert model.initial.total == pytest.approx(1.0)
    assert isinstance(plotting.spatial_kernel(kernel), Figure)


def test_mistakes(gas):
    with pytest.raises(sx.InputError) as caught:
        sp.measured_kernel(gas, 5.0, 2.0, bins_per_octave=0, fractal_dimension=9)
    assert len(caught.value.problems) == 3
    with pytest.raises(sx.InputError, match="too few to measure"):
        sp.measured_kernel(gas, 0.0, 1e-9)
    with pytest.raises(sx.InputError, match="kernel: must be"):
        plotting.spatial_kernel(gas.to_dataset())

"""Kernels of cloud droplets."""

from __future__ import annotations

import numpy as np
import pytest

from smolux.errors import InputError
from smolux.kernels import Fuchs, Long, from_dict

#: monomers of 1 µm in diameter; radii in µm, m³/s
LONG = {
    (10, 5): 1.682e-13, (30, 10): 1.209e-10, (49, 1): 2.293e-9, (50.001, 1): 3.027e-9,
    (100, 10): 2.424e-8,
}  # fmt: skip


def test_values_of_long() -> None:
    law = Long(1e-6)
    for (r, s), expected in LONG.items():
        found = float(law((2 * r) ** 3, (2 * s) ** 3))
        assert found == pytest.approx(expected, rel=5e-4, abs=0)
    # the edge itself is below it, and there is a jump of 17 %
    edge = 100.0**3
    assert float(law(edge + 1, 1) / law(edge, 1)) == pytest.approx(1.169, rel=1e-3)
    # a monomer beyond the edge
    assert float(Long(2e-4)(1, 1)) == pytest.approx(5.78e3 * 2 * np.pi / 6 * 8e-12, abs=0)


@pytest.mark.parametrize("diameter", [1e-9, 4e-6, 1e-3])
def test_long_for_all_sizes(diameter: float) -> None:
    law = Long(diameter)
    k = np.unique(np.concatenate([2.0 ** np.arange(0, 62.1), np.arange(1.0, 30)]))
    found = law(k[:, None], k)
    assert np.isfinite(found).all()
    assert (found > 0).all()
    np.testing.assert_allclose(found, found.T, rtol=1e-14)
    assert law.problems(2.0**62) == []
    lower, upper = law.bounds(k[:-1, None], k[1:, None], k[:-1], k[1:])
    assert (lower <= found[:-1, :-1]).all()
    assert (found[1:, 1:] <= upper).all()
    assert (np.diff(found, axis=0) >= 0).all()  # as the bounds need
    assert law.rigorous


def test_long_as_data() -> None:
    law = Long(4e-6)
    assert from_dict(law.to_dict()) == law
    with pytest.raises(InputError, match="monomer_diameter = 0"):
        Long(0)
    with pytest.raises(InputError, match="monomers differ"):
        law + Fuchs()

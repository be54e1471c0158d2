"""
Soot in a flame, in SI units
============================

Nascent soot, 1 nm in diameter, 1e12 particles per cubic centimetre at 1700 K, coagulates in the
free-molecular regime. All quantities are in SI units. After a few milliseconds, whatever the start,
the size distributions of all times fall on one self-preserving curve.

F. S. Lai, S. K. Friedlander, J. Pich, G. M. Hidy, J. Colloid Interface Sci. 39, 395 (1972),
doi:10.1016/0021-9797(72)90034-3.
"""

import math

import smolux as sx

volume = math.pi / 6 * (1e-9) ** 3  # of the monomer, m^3
model = sx.Model(
    kernel=sx.kernels.Ballistic.free_molecular(temperature=1700, density=1800, volume=volume),
    initial=sx.initial.monodisperse(density=1e18),  # per m^3
)
times = [3e-3, 10e-3, 30e-3, 100e-3]  # s

ds = sx.simulate(model, times, particles=50_000, replicas=8, seed=1)

figure = sx.plot.scaling(ds)
sx.plot.save(figure, "soot.png")

# %%
# Number of particles, and the diameter of a sphere of the mean volume.

density = ds["number_density"].mean("replica")
mean = ds["moment"].sel(order=1).mean("replica") / density
for t, n, size in zip(times, density.values, mean.values, strict=True):
    print(f"{1e3 * t:4.0f} ms: {1e-6 * n:.2e} per cm3, {size ** (1 / 3):.2f} nm")

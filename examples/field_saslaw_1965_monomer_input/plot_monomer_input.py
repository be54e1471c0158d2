"""
A power law from monomer input
==============================

Monomers come in at a constant rate and aggregate. Small sizes get steady, with densities that fall
as ``k**(-3/2)``; the end of this range moves on as the square of time, and the mass with it. In
mass flow one particle stands for a unit of mass, so there are enough of the large ones. In colour
the simulation, in black the exact steady state.

G. B. Field and W. C. Saslaw, Astrophys. J. 142, 568 (1965), doi:10.1086/148318.
"""

import numpy as np
from scipy.special import gammaln

import smolux as sx

rate = 1.0
model = sx.Model(
    kernel=sx.kernels.Constant(),
    processes=[sx.processes.Aggregation(), sx.processes.Source(rate)],
    initial=sx.initial.empty(),
)

ds = sx.simulate(model, [3, 10, 30, 100], particles=2000, replicas=8, weighting="mass-flow", seed=1)

figure = sx.plot.size_distribution(ds, reference=None)
k = np.geomspace(1, 1e4, 200)
choose = np.exp(gammaln(2 * k + 1) - 2 * gammaln(k + 1) - 2 * k * np.log(2))
figure.axes[0].plot(k, np.sqrt(2 * rate) * choose / (2 * k - 1), color="black", zorder=1)
sx.plot.save(figure, "monomer_input.png")

# %%
# The number of clusters grows to ``sqrt(2 J)``, as a hyperbolic tangent.

for t, number in zip(ds["time"].values, ds["number_density"].mean("replica").values, strict=True):
    print(f"t = {t:3g}: {number:.4f}, {np.sqrt(2 * rate) * np.tanh(t * np.sqrt(rate / 2)):.4f}")

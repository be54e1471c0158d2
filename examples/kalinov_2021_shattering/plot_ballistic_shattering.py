"""
Ballistic aggregation with shattering
=====================================

Particles in free flight stick when they meet; one encounter in a hundred shatters both into
monomers. Dots are a Monte Carlo simulation of the exact jump process, lines the rate equations: two
computations that share nothing but the description of the physics.

A. Kalinov et al., J. Comput. Phys. 467, 111439 (2022), doi:10.1016/j.jcp.2022.111439, section 5.
"""

import smolux as sx

model = sx.Model(
    kernel=sx.kernels.Ballistic(),
    processes=[sx.processes.Aggregation(), sx.processes.Shattering(0.01)],
    initial=sx.initial.monodisperse(density=1.0),
)
times = [0.1, 1, 10]

ds = sx.simulate(model, times, particles=100_000, replicas=8, seed=1)
rates = sx.solve(model, times)

figure = sx.plot.size_distribution(ds, reference=rates)
sx.plot.save(figure, "ballistic_shattering.png")

# %%
# Do they agree? All densities and moments are tested together, whatever their correlations.

agreement = sx.analysis.compare(ds, rates)
print(f"p = {agreement.p_value:.2f} over {agreement.entries} densities and moments")

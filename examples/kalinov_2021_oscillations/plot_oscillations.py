"""
Oscillations that never end
===========================

With the kernel ``(i/j)**a + (j/i)**a`` and little shattering the steady state is unstable: the size
distribution runs through a limit cycle for ever. Noise does not destroy it. The replicas drift
apart in phase, so each is drawn by itself; the black line is the solution of the rate equations.

S. A. Matveev et al., Phys. Rev. Lett. 119, 260601 (2017), doi:10.1103/PhysRevLett.119.260601;
A. Kalinov et al., J. Comput. Phys. 467, 111439 (2022), doi:10.1016/j.jcp.2022.111439, figure 2.
"""

import numpy as np

import smolux as sx

model = sx.Model(
    kernel=sx.kernels.GeneralizedBrownian(a=0.95),
    processes=[sx.processes.Aggregation(), sx.processes.Shattering(0.01)],
)
times = np.linspace(1, 150, 150)

ds = sx.simulate(model, times, particles=20_000, replicas=3, seed=1)
rates = sx.solve(model, times, tolerance=1e-6)

figure = sx.plot.oscillations(ds, reference=rates, start=50)
sx.plot.save(figure, "oscillations.png")

# %%
# The rate equations approach the limit cycle slowly; its period is 33.69 in the end.

cycle = sx.analysis.oscillations(rates, start=50).attrs
print(f"period {cycle['period']:.2f}, amplitude {cycle['amplitude']:.1f}")

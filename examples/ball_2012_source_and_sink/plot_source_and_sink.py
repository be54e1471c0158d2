"""
Source, sink and no steady state
================================

Monomers come in, and clusters of more than 400 of them are taken out. If small clusters meet large
ones far more often than their like, the flow of mass to large sizes comes in pulses that never end.
The replicas drift apart in phase, so each is drawn by itself; the black line is the solution of
the rate equations, with a period of 26.29 and between 0.3312 and 0.9747 clusters per volume.

R. C. Ball et al., Phys. Rev. Lett. 109, 168304 (2012), doi:10.1103/PhysRevLett.109.168304.
"""

import numpy as np

import smolux as sx

processes = sx.processes
model = sx.Model(
    kernel=sx.kernels.formula("((i/j)**a + (j/i)**a) / 2", a=0.95),
    processes=[processes.Aggregation(), processes.Source(1.0), processes.Removal(above=400)],
    initial=sx.initial.empty(),
)
times = np.linspace(0.5, 200, 400)

ds = sx.simulate(model, times, particles=20_000, replicas=3, seed=1)
rates = sx.solve(model, times, tolerance=1e-6)

figure = sx.plot.oscillations(
    ds, "number_density", against="moment", order=1, reference=rates, start=100
)
sx.plot.save(figure, "source_and_sink.png")

# %%
# What has come in is still there or has left: of each replica to the last monomer.

assert (ds["mass_in"] == ds["mass"] + ds["mass_out"]).all()
cycle = sx.analysis.oscillations(rates, "number_density", start=100).attrs
print(f"period {cycle['period']:.2f}, amplitude {cycle['amplitude']:.3f}")

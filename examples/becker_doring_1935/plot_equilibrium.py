"""
Clusters that gain and lose monomers
====================================

In the model of Becker and Döring clusters grow by monomers only, and lose them again. With both
rates equal to one the sizes are a geometric law in the end, ``n_k = z**k``, where the total mass
fixes z. Dots are the simulation, lines the rate equations.

R. Becker and W. Döring, Ann. Phys. 416, 719 (1935), doi:10.1002/andp.19354160806.
"""

import numpy as np

import smolux as sx

mass = 3.0
# two monomers meet at the rate 2, a monomer and a larger cluster at 1, and nothing else meets
attach = sx.kernels.formula("max(0, 2 - min(i, j)) * (1 + max(0, 2 - max(i, j)))")
model = sx.Model(
    kernel=attach,
    processes=[sx.processes.Aggregation(), sx.processes.Evaporation(1.0)],
    initial=sx.initial.monodisperse(density=mass),
)
times = [0.3, 3, 30, 300]

ds = sx.simulate(model, times, particles=20_000, replicas=8, seed=1)
rates = sx.solve(model, times, window=128)

figure = sx.plot.size_distribution(ds, reference=rates)
sx.plot.save(figure, "becker_doring.png")

# %%
# Equilibrium: z solves ``z / (1 - z)**2 = mass``.

z = (2 * mass + 1 - np.sqrt(4 * mass + 1)) / (2 * mass)
found = ds["n"].sel(time=300).mean("replica")
for k in (1, 2, 5, 10):
    print(f"n_{k} = {float(found.sel(size=k)):.5f}, in equilibrium {z**k:.5f}")

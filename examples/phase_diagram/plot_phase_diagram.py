"""
Where oscillations last
=======================

A sweep over the exponent ``a`` of the kernel ``(i/j)**a + (j/i)**a`` and the rate of shattering: do
the rate equations settle, or oscillate for ever? What is finished is kept in a folder: run the
script again, and only the figure is made anew. The line is where the steady state turns unstable;
near it swings grow or decay so slowly that it takes longer series than these to tell.

S. A. Matveev et al., Phys. Rev. Lett. 119, 260601 (2017), doi:10.1103/PhysRevLett.119.260601.
"""

import matplotlib.pyplot as plt

import smolux as sx
from smolux.case import Case, Solve
from smolux.deterministic import hopf_threshold

A, RATE = "kernel.a", "processes.shattering.rate"
shattering = [sx.processes.Aggregation(), sx.processes.Shattering(0.01)]
model = sx.Model(sx.kernels.GeneralizedBrownian(a=0.9), shattering)
case = Case(model, solve=Solve(times=tuple(range(1, 401)), tolerance=5e-3))
ds = sx.sweep(case, {A: [0.9, 0.925, 0.95], RATE: "0.008:0.024:3"}, directory="phase_diagram")

marks = {"persistent": "o", "decaying": "v", "undecided": "D", "none": "x"}
figure, axes = plt.subplots(figsize=(5.5, 4), layout="constrained")
for a, rate in ((a, rate) for a in ds[A].values for rate in ds[RATE].values):
    found = sx.analysis.oscillations(ds.sel({A: a, RATE: rate}), "number_density", start=20)
    cycle, verdict = found.attrs, str(found["verdict"].values[0])
    axes.plot(rate, a, marks[verdict], color="C0" if verdict == "persistent" else "0.6", ms=9)
    text = f"{verdict}\nperiod {cycle['period']:.0f}\namplitude {cycle['amplitude']:.3f}"
    axes.annotate(text, (rate, a), (8, -8), textcoords="offset points", fontsize=7)
border = {a: hopf_threshold(sx.kernels.GeneralizedBrownian(float(a))).rate for a in ds[A].values}
axes.plot(list(border.values()), list(border), "k--", zorder=0)
axes.set(xlabel="rate of shattering", ylabel="exponent a of the kernel", xlim=(0.006, 0.029))
axes.margins(y=0.15)
sx.plot.save(figure, "phase_diagram.png")

"""
Mixing of a tracer, and soot that is coated
===========================================

Half of the monomers are marked at the start, each particle being of one kind. As particles merge,
their compositions come together: the scatter among n particles of N monomers is (n - 1)/(N - 1) of
that of pure ones, whatever the kernel. Shattering goes on making pure particles, and a steady state
keeps its scatter. A source of soot in a cloud of sulphate shows how the fraction of soot depends on
the size.
"""

import matplotlib.pyplot as plt
import numpy as np

import smolux as sx

tracer = sx.attributes.Composition({"marked": 0.5, "plain": 0.5})
times = np.geomspace(0.1, 100, 25)
aggregation = sx.processes.Aggregation()
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")

for processes, label in (
    ([aggregation], "aggregation"),
    ([aggregation, sx.processes.Shattering(0.1)], "with shattering"),
):
    model = sx.Model(sx.kernels.Ballistic(), processes, attributes=[tracer])
    ds = sx.simulate(model, times, particles=20_000, replicas=4, seed=1)
    left.loglog(ds["time"], ds["mixing"].mean("replica"), "o", ms=4, label=label)
    monomers = ds["monomers"].sum("component")
    law = ((ds["particles"] - 1) / (monomers - 1)).mean("replica")
    left.loglog(ds["time"], law, "k-", lw=0.8)
left.set(xlabel="time", ylabel="scatter over that of pure particles")
left.legend(frameon=False)

cloud = sx.Model(
    sx.kernels.Ballistic(),
    [aggregation, sx.processes.Source(0.05, label="emission")],
    sx.initial.from_sizes({20: 0.05}),
    [sx.attributes.Composition({"soot": 0, "sulphate": 1}, sources={"emission": {"soot": 1}})],
)
ds = sx.simulate(cloud, [2, 10], particles=50_000, replicas=4, seed=2)
for time in ds["time"].values:
    at = ds.sel(time=time)
    seen = (at["n"] * at["volume"]).sum("replica") >= 20
    fraction = (at["composition"].sel(component="soot") / at["size"]).mean("replica").where(seen)
    right.semilogx(at["size"], fraction, ".", ms=3, label=f"t = {time:g}")
right.set(xlabel="size", ylabel="fraction of soot", xlim=(0.9, 300))
right.legend(frameon=False, markerscale=3)

sx.plot.save(figure, "mixing.png")

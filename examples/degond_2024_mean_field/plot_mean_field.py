"""
Where Smoluchowski's mean field holds, and where it breaks
==========================================================

Discs fly freely in a periodic box and stick where they touch. The collision kernel of each run is
measured from its merges, pair of sizes by pair of sizes, and the ballistic kernel of the mean field
is fitted to it. Then a well-mixed population coagulates with that kernel. In a dilute gas both
agree; in a dense one clusters soon fill the space between them, and no kernel of two sizes will do.

P. Degond, G. Dimarco, M. Ferreira, S. Hecht, on ballistic aggregation of discs.
"""

import smolux as sx

discs, pairs = 10_000, []
for fraction in (0.01, 0.3):
    system = sx.spatial.random(discs, fraction, walls="periodic", velocities="maxwellian", seed=1)
    spatial = sx.spatial.simulate(system, clusters=100)
    kernel = sx.spatial.measured_kernel(spatial)
    print(
        f"volume fraction {fraction:g}: the kernel has a fractal dimension of "
        f"{kernel.attrs['fractal_dimension']:.2f} ± {kernel.attrs['fractal_dimension_error']:.2f}, "
        f"chi2 = {kernel.attrs['chi2']:.1f}"
    )
    model = sx.spatial.mean_field_model(kernel)
    times = spatial["series/time"].values[1:]
    mixed = sx.simulate(
        model, times, particles=discs, replicas=4, population="fixed-volume", sizes=4096, seed=2
    )
    pairs.append((spatial, mixed))

figure = sx.plot.mean_field(pairs)
sx.plot.save(figure, "mean_field.png")

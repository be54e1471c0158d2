"""
A kernel of your own
====================

Any plain Python function of two sizes is a kernel; it is compiled, and its bounds are found. The
same law as a formula can stand in a case file. Here: droplets that meet by diffusion and in a shear
flow, with the strength of the shear as a parameter.
"""

import numpy as np

import smolux as sx


def rate(i, j, shear=0.01):
    """Brownian motion and shear together."""
    x, y = i ** (1 / 3), j ** (1 / 3)
    return (x + y) * (1 / x + 1 / y) + shear * (x + y) ** 3


function = sx.kernels.from_function(rate, shear=0.02)
formula = sx.kernels.formula(
    "(i**(1/3) + j**(1/3)) * (i**(-1/3) + j**(-1/3)) + shear * (i**(1/3) + j**(1/3))**3",
    shear=0.02,
)

times = np.linspace(0.25, 4, 16)
simulated = sx.simulate(sx.Model(kernel=function), times, particles=50_000, seed=1)
solved = sx.solve(sx.Model(kernel=formula), times)

figure = sx.plot.moments(simulated, reference=solved)
sx.plot.save(figure, "own_kernel.png")

print(sx.analysis.compare(simulated, solved).verdict)

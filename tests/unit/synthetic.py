"""Results with a known law, made without the program: exact samples of the constant kernel."""

from __future__ import annotations

import numpy as np

import smolux as sx
from smolux.results import to_dataset
from smolux.results.records import Records

SIZES = 64


def bin_edges(largest: float, per_octave: int = 4) -> np.ndarray:
    """Edges of whole sizes above `SIZES`."""
    powers = (SIZES + 1) * 2.0 ** (np.arange(0, 200) / per_octave)
    edges = np.unique(np.ceil(powers))
    return edges[: np.searchsorted(edges, largest, side="right") + 1]


def coalescent(particles, times, rng):
    """Cluster sizes at each time for the kernel 1 and monomers of unit density.

    Of k clusters two merge after an exponential time of rate ``k (k - 1) / (2 N)``. In random order
    the sizes are a chain of N monomers with k - 1 of its N - 1 bonds cut, and each merger mends one
    of the cuts at random.
    """
    k = np.arange(particles, 1, -1)
    clock = np.cumsum(rng.exponential(2 * particles / (k * (k - 1.0))))
    cuts = rng.permutation(particles - 1) + 1
    left = particles - np.searchsorted(clock, times, side="right")
    return [
        np.diff(np.concatenate(([0], np.sort(cuts[: c - 1]), [particles]))) for c in left
    ], clock[-1]


def constant_kernel(
    particles=2000,
    replicas=8,
    times=(0.0, 0.5, 1.0, 2.0, 5.0, 10.0),
    seed=1,
    distribution=False,
    **attributes,
):
    """Records of the constant kernel, drawn from the exact law of the finite system."""
    rng = np.random.default_rng(seed)
    times, orders = np.asarray(times, float), np.arange(4.0)
    edges = bin_edges(particles)
    shape = (replicas, len(times))
    number, largest, collisions = np.empty(shape), np.empty(shape), np.empty(shape)
    moment = np.empty((*shape, 4))
    n, n_bin = np.empty((*shape, SIZES)), np.empty((*shape, len(edges) - 1))
    extinct, whole = np.full(replicas, np.nan), []
    for r in range(replicas):
        states, end = coalescent(particles, times, rng)
        extinct[r] = end if end <= times[-1] else np.nan
        whole.append([np.unique(s, return_counts=True) for s in states])
        for t, sizes in enumerate(states):
            number[r, t], largest[r, t] = len(sizes) / particles, sizes.max()
            collisions[r, t] = particles - len(sizes)
            moment[r, t] = [np.sum(sizes.astype(float) ** p) / particles for p in orders]
            n[r, t] = np.bincount(sizes, minlength=SIZES + 1)[1 : SIZES + 1] / particles
            n_bin[r, t] = np.histogram(sizes, edges)[0] / particles
    return Records(
        times=times,
        orders=orders,
        processes=("aggregation",),
        bin_edges=edges,
        values={
            "number_density": number,
            "largest": largest,
            "particles": number * particles,
            "collisions": collisions,
            "volume": np.full(shape, float(particles)),
            "moment": moment,
            "n": n,
            "n_bin": n_bin,
            "events": collisions[..., None].copy(),
            "extinction_time": extinct,
        },
        distribution=whole if distribution else None,
        attributes={"method": "synthetic", "seed": seed, **attributes},
    )


def model():
    """The constant kernel with monomers of unit density."""
    return sx.Model(kernel=sx.kernels.Constant())


def constant_dataset(**options):
    """Dataset of `constant_kernel`."""
    return to_dataset(model(), constant_kernel(**options))


def solver_dataset(times=(0.0, 0.5, 1.0, 2.0, 5.0, 10.0), largest=4000):
    """What a solver returns for the constant kernel, from the formula."""
    times = np.asarray(times, float)
    k = np.arange(1, largest + 1.0)
    t = times[:, None]
    with np.errstate(divide="ignore"):
        n = (2 / (t + 2)) ** 2 * (t / (t + 2)) ** (k - 1)
    edges = bin_edges(largest)
    which = np.searchsorted(edges, k, side="right") - 1
    n_bin = np.stack([n[:, which == b].sum(1) for b in range(len(edges) - 1)], axis=1)
    nan = np.full((1, len(times)), np.nan)
    records = Records(
        times=times,
        orders=np.arange(4.0),
        processes=("aggregation",),
        bin_edges=edges,
        values={
            "number_density": 2 / (times + 2)[None],
            "largest": np.full((1, len(times)), float(largest)),
            "particles": nan,
            "collisions": 1 - 2 / (times + 2)[None],
            "volume": np.ones((1, len(times))),
            "moment": np.stack(
                [2 / (times + 2), np.ones_like(times), 1 + times, 1 + 3 * times + 1.5 * times**2],
                axis=1,
            )[None],
            "n": n[None, :, :SIZES],
            "n_bin": n_bin[None],
            "events": (1 - 2 / (times + 2))[None, :, None],
            "extinction_time": np.array([np.nan]),
        },
        attributes={"method": "direct"},
    )
    return to_dataset(model(), records)

"""How often the intervals of few replicas hold: measured over thousands of groups of replicas."""

from verification.suite import Suite

from . import replicas, stopping

SUITE = Suite(
    name="coverage",
    title="Coverage of the intervals",
    paper="the promise of 95 %: how often the intervals of `smolux.summary`, of `smolux.ensemble` "
    "and of `target_error` hold.",
    items=(replicas.MEANS, replicas.VARIANCES, stopping.ITEM),
    remarks=(
        "An interval should hold the mean, or the variance, of the finite system, which is known "
        "from all replicas together. The bias of a finite population is no part of it.",
        "2000 groups of R replicas, none of which shares a replica with another of the same R. "
        "The standard deviation of a share of 95 % is 0.5 %.",
        "In brackets the share of groups whose result says itself that there are too few replicas "
        "to promise 95 %: a question mark in tables, `doubtful` in a summary.",
    ),
)

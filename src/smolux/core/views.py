"""One replica of many, one observation of many: views of the arrays that hold them."""

from __future__ import annotations

from smolux.jit.compile import piece

from .state import State, Tally


@piece
def state_of(state, r):
    """State of one replica."""
    return State(
        state.rng[r],
        state.clock[r],
        state.count[r],
        state.events[r],
        state.sizes[r],
        state.counts[r],
        state.attempts[r],
        state.held[r],
        state.most[r],
        state.sums[r],
        state.missed[r],
    )


@piece
def tally_of(tally, k):
    """Observations of replica `k`; of one replica, that at time `k`."""
    return Tally(
        tally.scalars[k],
        tally.processes[k],
        tally.counts[k],
        tally.bins[k],
        tally.sums[k],
        tally.rows[k],
    )

"""What a run does when particles get few: a policy of the run, whatever the method."""

from __future__ import annotations

#: every policy, and what it does
POPULATIONS = {
    "doubling": "the volume is doubled, every particle put in once more, when half are left",
    "fixed-volume": "nothing: the volume stays, and particles may end as one cluster",
    "none": "another word for fixed-volume",
}


def doubles_at(policy: str, particles: int) -> int:
    """Return the number of particles at or below which the volume is doubled; 0 for never."""
    return particles // 2 if policy == "doubling" else 0

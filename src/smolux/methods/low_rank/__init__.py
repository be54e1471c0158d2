"""Low-rank and fictitious jumps: both particles by segment trees, from a majorant."""

"""The inverse method: both particles by cumulative sums."""

"""A stochastic run: what is decided before it, a `Plan`, and what drives it."""

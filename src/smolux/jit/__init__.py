"""All that knows the insides of Numba."""

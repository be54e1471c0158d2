"""The compiled part: event loop, random numbers, stores. Imports only NumPy and Numba."""

"""Acceptance-rejection: pairs of equal chance, thinned by the rate over its bound."""

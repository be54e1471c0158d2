"""Published results, computed again: slow, with figures and tables for the documentation."""

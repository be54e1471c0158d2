"""What runs of discs in a box are read for."""

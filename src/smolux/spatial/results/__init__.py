"""What a run of discs in a box leaves, and what is replayed from it."""

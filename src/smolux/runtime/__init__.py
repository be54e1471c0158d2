"""What the machine and the user grant a run: memory, cores, workers, files; progress and stops."""

"""The commands: each is the function of that name in the file of that name."""

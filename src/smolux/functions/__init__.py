"""What a user may write where a number stands: its text, values, bounds and content."""

"""The size-class method: pairs of classes from a frozen table."""

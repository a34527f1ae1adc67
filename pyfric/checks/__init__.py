"""Checks of correctness, accuracy and cost; import each module by itself, because it is slow."""

"""Checks of correctness, accuracy and cost. Import single modules, because imports are slow."""

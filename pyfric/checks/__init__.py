"""Is it right, how good, how fast."""

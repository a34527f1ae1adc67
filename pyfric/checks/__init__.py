"""Is it right, how good, how fast. Each module is imported by itself, as each takes its time."""

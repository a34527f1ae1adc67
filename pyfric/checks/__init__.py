"""Is it right, how good, how fast: one module for each command."""

from pyfric.checks import (
    bench,
    bench_fidelity,
    chart,
    regimes,
    regression,
    resolution,
    stability,
    verify,
)

__all__ = [
    "bench",
    "bench_fidelity",
    "chart",
    "regimes",
    "regression",
    "resolution",
    "stability",
    "verify",
]

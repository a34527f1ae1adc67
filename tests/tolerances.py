"""Tolerances that several tests share, or that do not explain themselves, each with its reason."""

ROUNDING = 2e-15
"""Relative difference that rounding explains in one evaluation of the forces: nine units of the
last place."""

REPRODUCED = 1e-10
"""Two runs of the hybrid engine that should be one run, over the largest value: cut in two, on
other threads or in another variant. Its static states and modes come from LAPACK, whose sums follow
the number of right-hand sides and the processor. Measured: below 1e-12."""

FORCE = 1e-6
"""Start and arrest forces of the hybrid engine against full dynamics, over F_N, in linear geometry:
the closed forms are exact there, and a jump drops only a remainder that has died away. Measured:
below 1e-9."""

FORCE_FINITE = 2e-5
"""The same in finite geometry, where the modes are those of the loaded state, a few 1e-3 of strain
away. Measured: below 1e-5."""

FORCE_STRAINED = 1.5e-4
"""The same at strains of 0.1 to 0.2, or where the driver is stiffer than the slider: modes follow
the tangent within 2 %. Measured: 9e-5."""

CURVE = 1e-5
"""F_T between events, over F_N; ten times as much in finite geometry, for the same reasons."""

SPLIT = 1e-8
"""Two halves of a run of the hybrid engine beside the whole, over the largest value: jumps begin at
other steps, each with an error of 2e-9 F_N at most. Measured: 4e-10."""

SEQUENCE = 1e-12
"""Forces of quasi-static sequences of the core beside those in Python, over F_N: both add the same
numbers in another order. Measured: below 6e-13, where sequences are no longer than those of the
tests."""

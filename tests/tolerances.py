"""Tolerances that several tests use or that need an explanation, each with its reason."""

ROUNDING = 2e-15
"""Relative difference that rounding explains in one evaluation of the forces: nine units of the
last place."""

REPRODUCED = 1e-10
"""Two runs of the hybrid engine that should be one run, over the largest value: cut in two, on
other threads or in another variant. Its static states and modes come from LAPACK, whose sums depend
on the number of right-hand sides and the processor. Measured: below 1e-12."""

FORCE = 1e-6
"""Start and arrest forces of the hybrid engine against full dynamics, over F_N, in linear geometry.
Closed forms are exact there, and a jump drops only decayed motion. Measured: below 1e-9."""

FORCE_FINITE = 2e-5
"""Start and arrest forces in finite geometry. Modes are those of the loaded state, and strains
change by a few 1e-3. Measured: below 1e-5."""

FORCE_STRAINED = 1.5e-4
"""Start and arrest forces at strains of 0.1 to 0.2, or with a driver stiffer than the slider. Modes
follow the tangent within 2 %. Measured: 9e-5."""

CURVE = 1e-5
"""F_T between events, over F_N. In finite geometry the tolerance is ten times as large."""

SPLIT = 1e-8
"""Two halves of a run of the hybrid engine against the whole run, over the largest value. Jumps
begin at other steps, each with an error of at most 2e-9 F_N. Measured: 4e-10."""

SEQUENCE = 1e-12
"""Forces of quasi-static sequences of the core against those in Python, over F_N. The two sequences
add the same numbers in different order. Measured: below 6e-13 in sequences as long as in the
tests."""

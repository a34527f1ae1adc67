#!/bin/sh
# netCDF4 1.7.4 (Python).
#
# Input: a variable of bytes without _FillValue that holds all values of its type, such as flags or raw counts of a recorder.
# Expected: all values are read back. The User's Guide (Attribute Conventions, valid_range) says that the valid range of bytes
# includes all possible values unless _FillValue is given.
# Seen: -127 of a signed byte and 255 of an unsigned byte are read back masked. With fill_value=False they are read back
# unmasked.
# Flags in the files of pyfric are bytes that hold 0 or 1 only.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet netCDF4==1.7.4 numpy==2.4.6
cd "$folder"
bin/python - <<'END'
import sys

import netCDF4
import numpy as np

KINDS = "i1", "u1"


def lost(**how):
    """Values of a byte that come back masked, for each kind."""
    with netCDF4.Dataset("flags.nc", "w") as file:
        file.createDimension("x", 256)
        for kind in KINDS:
            file.createVariable(kind, kind, ("x",), **how)[:] = np.arange(256, dtype="u1").view(kind)
    with netCDF4.Dataset("flags.nc") as file:
        found = {}
        for kind in KINDS:
            got = file[kind][:]
            assert file[kind].ncattrs() == []
            found[kind] = got.data[np.ma.getmaskarray(got)].tolist()
    return found


plain, unfilled = lost(), lost(fill_value=False)
print("masked without a fill value:", plain)
print("masked with fill_value=False:", unfilled)
sys.exit(not (plain == {"i1": [-127], "u1": [255]} and unfilled == {"i1": [], "u1": []}))
END

#!/bin/sh
# xarray 2026.9.0, Dataset.to_netcdf, and netCDF4 1.7.4.
#
# Input: forces of up to 40 kN, packed as netCDF files often are: 16-bit integers with a scale_factor of 1 N.
# Expected: an error, since the largest integer is 32767, or the largest force that fits.
# Seen: 40 000 N are read back as -25 536 N, from both packages and without a warning. The conventions for packed data leave the
# range to the writer.
# pyfric writes no packed values. In such a file look for jumps by 65 536 steps of its scale.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet xarray==2026.9.0 netCDF4==1.7.4 numpy==2.4.6
cd "$folder"
bin/python -W error - <<'END'
import sys

import netCDF4
import numpy as np
import xarray

forces = np.array([100.0, 32000.0, 40000.0])
packed = {"dtype": "int16", "scale_factor": 1.0, "_FillValue": -32768}
xarray.Dataset({"F": ("t", forces)}).to_netcdf("one.nc", encoding={"F": packed}, engine="netcdf4")
with netCDF4.Dataset("other.nc", "w") as file:
    file.createDimension("t", 3)
    variable = file.createVariable("F", "i2", ("t",), fill_value=-32768)
    variable.scale_factor = 1.0
    variable[:] = forces
found = []
for name in ("one.nc", "other.nc"):
    with netCDF4.Dataset(name) as file:
        found.append(file["F"][:].tolist())
print("written:", forces.tolist(), "by xarray:", found[0], "by netCDF4:", found[1])
sys.exit(found != [[100.0, 32000.0, -25536.0]] * 2)
END

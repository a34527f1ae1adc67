#!/bin/sh
# npTDMS 1.13.0, TdmsWriter.
#
# Input: forces in a big-endian array of NumPy, as readers of binary files give them, such as scipy.io.netcdf_file. NumPy
# calculates with this array as with any other.
# Expected: the file holds these forces. The documentation asks for a 1-D array of NumPy and does not mention the order of
# bytes.
# Seen: bytes are written as they are, in a file marked as little-endian. Forces of 1, 2 and 3.5 N are read back as 3e-319,
# 3e-322 and 2e-320 N, integers of 1, 2, 300 as 16777216, 33554432, 738263040. After astype(float) forces are read back right.
# pyfric reads TDMS and writes none.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet npTDMS==1.13.0 scipy==1.17.1 numpy==2.4.6
cd "$folder"
bin/python -W error - <<'END'
import io
import sys

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from scipy.io import netcdf_file


def kept(values):
    """What comes back of a channel."""
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("run", "force", values)])
    file.seek(0)
    return TdmsFile.read(file)["run"]["force"][:]


with netcdf_file("run.nc", "w") as file:
    file.createDimension("sample", 3)
    file.createVariable("force", "f8", ("sample",))[:] = [1, 2, 3.5]
    file.createVariable("counts", "i4", ("sample",))[:] = [1, 2, 300]
with netcdf_file("run.nc", mmap=False) as file:
    force, counts = file.variables["force"].data, file.variables["counts"].data
lost, native, whole = kept(force), kept(force.astype(float)), kept(counts)
print("force:", force.dtype, force, "comes back as", lost, "after astype(float) as", native)
print("counts:", counts.dtype, counts, "come back as", whole)
swapped = lost.tobytes() == force.tobytes() and whole.tobytes() == counts.tobytes()
sys.exit(not (swapped and max(lost) < 1e-300 and list(native) == list(force) and whole[0] == 2**24))
END

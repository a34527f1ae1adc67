#!/bin/sh
# h5py 3.14.0, AttributeManager.modify.
#
# Input: an attribute with a text of fixed length, the form that every reader of netCDF knows, and a longer text to replace it.
# Expected: the longer text, or an error because it does not fit.
# Seen: modify cuts the new text to the old length without a warning: "m" stays "m" where "mm/s" was written. Plain assignment
# makes a new attribute and keeps the whole text.
# pyfric's records have such attributes; its record page says how to change one.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet h5py==3.14.0 numpy==2.2.6
"$folder/bin/python" - <<'END'
import io, sys
import h5py
import numpy as np

with h5py.File(io.BytesIO(), "w") as file:
    file.attrs["units"] = np.bytes_("m")
    file.attrs.modify("units", np.bytes_("mm/s"))
    modified = file.attrs["units"]
    file.attrs["units"] = np.bytes_("mm/s")
    print("modified:", modified, "assigned:", file.attrs["units"])
    sys.exit((modified, file.attrs["units"]) != (b"m", b"mm/s"))
END

#!/bin/sh
# pint 0.25.3.
#
# Input: lengths, speeds and forces with a decimal comma, as many countries write them and instruments export them.
# Expected: 1.5 mm for "1,5 mm", or an error, as unyt gives. The documentation does not mention commas.
# Seen: commas are dropped. "1,5 mm" is 15 mm, "12,5 mm/s" is 125 mm/s, and "1.234,5 N" is 1.2345 N.
# pyfric reads the number itself, refuses a comma in it, and asks pint for the unit alone.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet pint==0.25.3 unyt==3.2.0 numpy==2.4.6
"$folder/bin/python" -W error - <<'END'
import sys

import pint
import unyt

units = pint.UnitRegistry()
texts = {"1,5 mm": (15, "mm"), "12,5 mm/s": (125, "mm/s"), "1.234,5 N": (1.2345, "N")}
same = True
for text, (wrong, unit) in texts.items():
    value = units.Quantity(text)
    print(text, "is", value)
    same &= value.units == units.Unit(unit) and abs(value.magnitude - wrong) < 1e-12
try:
    unyt.unyt_quantity.from_string("1,5 mm")
    refused = False
except ValueError as error:
    print("unyt:", error)
    refused = True
sys.exit(not (same and refused))
END

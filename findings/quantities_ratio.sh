#!/bin/sh
# quantities 0.16.4.
#
# Input: a slip of 1 mm over a length of 1 m, as a plain number, for a law that takes a number.
# Expected: 0.001, as pint and unyt give, or an error. Other functions of the package, such as exp, refuse the ratio.
# Seen: float() of the ratio is 1.0, and NumPy's interp uses 1.0, too. A ratio keeps the unit mm/m, and float() drops it. With
# .simplified it is 0.001.
# pyfric refuses quantities of this package, and arrays with a unit of any other package where it takes plain numbers.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet quantities==0.16.4 pint==0.25.3 unyt==3.2.0 numpy==2.4.6
"$folder/bin/python" -W error - <<'END'
import sys

import numpy as np
import pint
import quantities
import unyt

units = pint.UnitRegistry()
ratio = quantities.Quantity(1.0, "mm") / quantities.Quantity(1.0, "m")
others = [
    float(units.Quantity(1.0, "mm") / units.Quantity(1.0, "m")),
    float(unyt.unyt_quantity(1.0, "mm") / unyt.unyt_quantity(1.0, "m")),
]
law = float(np.interp(ratio, [0.0, 1.0], [0.7, 0.4]))
try:
    np.exp(ratio)
    refused = False
except ValueError:
    refused = True
print("quantities:", ratio, float(ratio), "simplified:", float(ratio.simplified), "interp:", law)
print("pint, unyt:", *others, "exp refused:", refused)
known = float(ratio) == 1.0 and law == 0.4 and float(ratio.simplified) == 0.001
sys.exit(not (known and others == [0.001] * 2 and refused))
END

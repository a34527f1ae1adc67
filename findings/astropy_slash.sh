#!/bin/sh
# astropy 8.0.2, astropy.units, beside cf-units 3.3.1 (UDUNITS) and pint 0.25.3.
#
# Input: "N/m s" as the unit of a dashpot, such as an attribute of a netCDF file has.
# Expected: one meaning. UDUNITS, the reference for conventions of netCDF, and pint read it from left to right, as N s/m.
# Seen: astropy reads N/(m s) without a warning, although it warns of two slashes. Its reader of the format OGIP gives N s/m.
# pyfric writes "N s/m", which all of these libraries read alike. It refuses text that does not convert to this unit.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
# Wheels of cf-units hold the library of UDUNITS.
export PIP_ONLY_BINARY=cf-units
trap 'rm -rf "$folder"; exit 2' EXIT
"$folder/bin/pip" install --quiet astropy==8.0.2 cf-units==3.3.1 pint==0.25.3 numpy==2.4.6
trap 'rm -rf "$folder"' EXIT
"$folder/bin/python" -W error - <<'END'
import sys

import astropy.units
import cf_units
import pint

units = pint.UnitRegistry()
TEXT, SAFE = "N/m s", "N s/m"
generic, ogip = astropy.units.Unit(TEXT), astropy.units.Unit(TEXT, format="ogip")
dashpot = astropy.units.N * astropy.units.s / astropy.units.m
print(f"{TEXT}: astropy {generic}, its OGIP {ogip}, pint {units.Unit(TEXT)}")
print(f"{TEXT}: UDUNITS {cf_units.Unit(TEXT).definition}")
left = cf_units.Unit(TEXT) == cf_units.Unit("kg s-1") and units.Unit(TEXT) == units.Unit(SAFE)
alike = astropy.units.Unit(SAFE) == dashpot and cf_units.Unit(SAFE) == cf_units.Unit("kg s-1")
other = generic == dashpot / astropy.units.s**2 and ogip == dashpot
sys.exit(not (left and alike and other))
END

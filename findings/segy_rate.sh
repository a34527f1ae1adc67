#!/bin/sh
# ObsPy 1.5.1, Stream.write with format SEGY.
#
# Input: records of 51.2 kHz, 102.4 kHz and 5 MHz, as laboratory recorders of sound and acoustic emission give.
# Expected: they are read back with their rates, or refused. The documentation of the writer says that the format has whole
# microseconds, and the writer refuses records with more than 65535 us between samples.
# Seen: the writer cuts (does not round) the interval to whole microseconds without a warning. The records are read back with
# 52.6 kHz, 111 kHz and 1 Hz, so an event at 1 s is at 0.97 s or 0.92 s. The writer of the same package for format SU rounds.
# pyfric reads and writes no SEG-Y. Compare a rate in such a file with that of the recorder.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet obspy==1.5.1 numpy==2.4.6
cd "$folder"
bin/python -W ignore - <<'END'
import sys

import numpy as np
from obspy import Trace, read
from obspy.io.segy.core import SEGYSampleIntervalError


def kept(rate, kind="SEGY"):
    """Sampling rate in Hz of a record of 1000 samples that was written and read again."""
    trace = Trace(np.zeros(1000, "f4"), {"sampling_rate": rate})
    trace.write("record.segy", format=kind)
    return read("record.segy", format=kind)[0].stats.sampling_rate


rates = 50e3, 51.2e3, 102.4e3, 5e6
found = [kept(rate) for rate in rates]
rounded = kept(51.2e3, "SU")
try:
    kept(1.0)
    refused = False
except SEGYSampleIntervalError:
    refused = True
print("written, read, in Hz:", *zip(rates, found))
print("51200 Hz in format SU:", rounded, "1 Hz refused:", refused)
right = [50e3, 1e6 / 19, 1e6 / 9, 1.0]
sys.exit(not (np.allclose(found, right, rtol=1e-9) and np.isclose(rounded, 50e3) and refused))
END

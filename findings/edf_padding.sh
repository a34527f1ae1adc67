#!/bin/sh
# pyEDFlib 0.1.42, EdfWriter.writeSamples.
#
# Input: 2.5 s of a force at 1000 samples per second, 500 N throughout, written as EDF, a format of recorders with many
# channels.
# Expected: 2500 samples are read back, or an error. The documentation of the method does not mention this case.
# Seen: 3000 samples are read back, the last 500 of which are 0 N, and the duration is 3 s: the writer fills the last second. At
# the end of a record this looks like a stress drop. 3 s are read back as they are.
# pyfric reads and writes no EDF. Before you convert such a file, cut it after the last sample of the recorder.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet pyEDFlib==0.1.42 numpy==2.4.6
cd "$folder"
bin/python -W error - <<'END'
import sys

import numpy as np
from pyedflib import FILETYPE_EDFPLUS, EdfReader, EdfWriter

HEADER = {
    "label": "F", "dimension": "N", "sample_frequency": 1000, "transducer": "", "prefilter": "",
    "physical_min": 0.0, "physical_max": 1000.0, "digital_min": -32768, "digital_max": 32767,
}  # fmt: skip


def kept(samples):
    """Number of samples, first and last one of a constant force of 500 N, and the duration in s."""
    with EdfWriter("force.edf", 1, file_type=FILETYPE_EDFPLUS) as file:
        file.setSignalHeaders([HEADER])
        file.writeSamples([np.full(samples, 500.0)])
    with EdfReader("force.edf") as file:
        force = file.readSignal(0)
        return len(force), round(force[0]), round(force[-1]), round(force[2499]), file.getFileDuration()


cut, whole = kept(2500), kept(3000)
print("samples, first, last, sample 2500 (N), duration (s): 2500 become", cut, "3000 become", whole)
sys.exit(not (cut == (3000, 500, 0, 500, 3.0) and whole == (3000, 500, 500, 500, 3.0)))
END

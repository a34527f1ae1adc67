#!/bin/sh
# libgomp 11 (the OpenMP library of GCC), as in the wheel of scikit-learn 1.5.2.
#
# Input: a process with OMP_PROC_BIND=true, which clusters recommend, loads the library. No thread is started.
# Expected: threads of a team are bound when they start; the process keeps its processors.
# Seen: the first thread of the process is bound at once. os.sched_getaffinity(0) then returns one processor. Child processes
# inherit this, so workers share one processor.
# pyfric gives the process its processors back after it has loaded its core.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet scikit-learn==1.5.2 numpy==2.2.6 scipy==1.15.3
OMP_PROC_BIND=true "$folder/bin/python" - <<'END'
import ctypes, glob, os, subprocess, sys, sysconfig

def allowed():
    return len(os.sched_getaffinity(0))

before = allowed()
if before < 2:
    print("needs two processors")
    sys.exit(2)
(library,) = glob.glob(sysconfig.get_path("purelib") + "/scikit_learn.libs/libgomp*")
ctypes.CDLL(library)
child = "import os; print(len(os.sched_getaffinity(0)))"
in_child = int(subprocess.run([sys.executable, "-c", child], capture_output=True).stdout)
print(f"processors: {before} before, {allowed()} after, {in_child} in a child")
sys.exit((allowed(), in_child) != (1, 1))
END

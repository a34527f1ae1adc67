#!/bin/sh
# MuJoCo 4.0.0.
#
# Input: a block of friction 0.3 on a plane whose friction is not set, pushed by half of its weight.
# Expected: it slides, because 0.5 > 0.3, as it does in programs that multiply coefficients of a pair or take their harmonic
# mean.
# Seen: the contact takes the larger coefficient, 1 of the plane, and the block stays within millimetres. With 0.3 on both it
# slides.
# For a measured pair of materials set the coefficient of both bodies, as the study of blocks that stick does.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet mujoco==4.0.0 mujoco-core==4.0.0 mujoco-studio==4.0.0
"$folder/bin/python" - <<'END'
import sys
import mujoco

SCENE = """<mujoco><option gravity="0 0 -10"/><worldbody><geom type="plane" size="9 9 1" {of_plane}/>
<body pos="0 0 .1"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
<geom type="box" size=".1 .1 .1" mass="1" friction="0.3"/></body></worldbody></mujoco>"""

def moved(of_plane):
    """Return the coefficient of the contact and the displacement in 1 s, m."""
    model = mujoco.MjModel.from_xml_string(SCENE.format(of_plane=of_plane))
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = 5.0
    mujoco.mj_step(model, data)
    friction = float(data.contact.friction[0, 0])
    while data.time < 1:
        mujoco.mj_step(model, data)
    return friction, round(float(data.qpos[0]), 3)

default, both = moved(""), moved('friction="0.3"')
print("plane not set:", default, "both 0.3:", both)
sys.exit(not (default[0] == 1.0 and default[1] < 0.02 and both[0] == 0.3 and both[1] > 0.5))
END

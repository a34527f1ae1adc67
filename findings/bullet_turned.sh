#!/bin/sh
# PyBullet 3.2.7.
#
# Input: a square plate slides over a plane at 1 m/s, with friction 0.5 and gravity 10 m/s^2, parallel to two of its edges. The
# scene is repeated with plate and speed turned by 45 and by 90 degrees about the vertical.
# Expected: the plate stops after v^2/(2 mu g) = 100 mm each time. Nothing in the scene has a direction, and the guide says that
# the default is a cone of friction.
# Seen: turned by 45 degrees the plate stops after 114 mm, as with friction 0.44. Smaller steps and more iterations of the
# solver do not change this. The guide suggests the pyramid (enableConeFriction=0) if friction looks wrong; it gives 70 mm. A
# change proposed to its authors explains the error: the solver treats two components along axes of the world one after the
# other, with different masses.
# pyfric slides along one line. To compare with this program, let the plate slide along x or y of the world.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
# Its wheels are for some versions of Python only.
export PIP_ONLY_BINARY=pybullet
trap 'rm -rf "$folder"; exit 2' EXIT
"$folder/bin/pip" install --quiet pybullet==3.2.7 numpy==2.4.6
trap 'rm -rf "$folder"' EXIT
"$folder/bin/python" - <<'END'
import math
import sys

import pybullet

G, MU, V = 10.0, 0.5, 1.0  # m/s^2, -, m/s
pybullet.connect(pybullet.DIRECT)


def stops(degrees, step=1e-3, iterations=50, cone=1):
    """Distance in m until the plate is at rest."""
    pybullet.resetSimulation()
    pybullet.setGravity(0, 0, -G)
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=step, numSolverIterations=iterations, enableConeFriction=cone
    )
    plane = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.2, 0.2, 0.05])
    turn = math.radians(degrees)
    upright = pybullet.getQuaternionFromEuler([0, 0, turn])
    plate = pybullet.createMultiBody(1, shape, basePosition=[0, 0, 0.05], baseOrientation=upright)
    pybullet.changeDynamics(plane, -1, lateralFriction=1)
    pybullet.changeDynamics(plate, -1, lateralFriction=MU, linearDamping=0, angularDamping=0)
    for _ in range(200):
        pybullet.stepSimulation()
    start, _ = pybullet.getBasePositionAndOrientation(plate)
    pybullet.resetBaseVelocity(plate, [V * math.cos(turn), V * math.sin(turn), 0], [0, 0, 0])
    for _ in range(round(0.5 / step)):
        pybullet.stepSimulation()
    end, _ = pybullet.getBasePositionAndOrientation(plate)
    return math.dist(start[:2], end[:2])


straight, turned, quarter = stops(0), stops(45), stops(90)
others, pyramid = [stops(45, step=2e-4), stops(45, iterations=500)], stops(45, cone=0)
print("stops after, in m:", straight, "turned by 45 degrees:", turned, "by 90 degrees:", quarter)
print("45 degrees with smaller steps, with more iterations:", *others, "with the pyramid:", pyramid)
right = V**2 / (2 * MU * G)
along = max(abs(straight - right), abs(quarter - right)) < 0.002
sys.exit(not (along and min(turned, *others) > 0.108 and pyramid < 0.08))
END

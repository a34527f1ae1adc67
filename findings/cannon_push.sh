#!/bin/sh
# cannon-es 0.20.0, a program for rigid bodies in JavaScript.
#
# Input: a block of 1 kg with friction 0.5 on a plane, gravity 10 m/s^2. It is pushed along the plane for a second, with steps
# of 1/60 s, 1/120 s and 1/240 s.
# Expected: the block slides if the push is above 5 N, for each step. The documentation says that the largest friction force is
# mu times mass times gravity.
# Seen: the block stays below 1200 N, 2400 N and 4800 N, and slides above. The solver uses this force, at each of the four
# contacts, as the largest impulse of a step. Smaller steps thus make friction larger.
# pyfric limits the force of friction at any step. To compare with this program, divide the coefficient by the steps per second
# and by the number of contacts.
set -eu
command -v node >/dev/null && command -v npm >/dev/null || exit 2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
echo '{}' >package.json
trap 'rm -rf "$folder"; exit 2' EXIT
npm install --quiet cannon-es@0.20.0
trap 'rm -rf "$folder"' EXIT
cat >push.mjs <<'END'
import { Body, Box, Plane, Vec3, World } from 'cannon-es'

const MU = 0.5, MASS = 1, G = 10 // -, kg, m/s^2

// Displacement in m after a push of 1 s with `push` N.
function moved(push, mu, rate) {
  const world = new World({ gravity: new Vec3(0, 0, -G) })
  world.defaultContactMaterial.friction = mu
  world.solver.iterations = 50
  world.addBody(new Body({ mass: 0, shape: new Plane() }))
  const block = new Body({ mass: MASS, shape: new Box(new Vec3(0.2, 0.2, 0.05)), position: new Vec3(0, 0, 0.05),
    linearDamping: 0, angularDamping: 0, fixedRotation: true })
  block.updateMassProperties()
  world.addBody(block)
  const steps = along => {
    for (let n = 0; n < rate; n++) {
      block.applyForce(new Vec3(along, 0, 0))
      world.step(1 / rate)
    }
  }
  steps(0)
  const start = block.position.x
  steps(push)
  return block.position.x - start
}

// Whether the block stays with 0.99 of a push in N, and slides with 1.01 of it.
function limit(push, mu, rate) {
  const [below, above] = [0.99, 1.01].map(part => moved(part * push, mu, rate))
  console.log(`mu ${mu}, steps of 1/${rate} s: ${0.99 * push} N move it by ${below} m, ${1.01 * push} N by ${above} m`)
  return below < 0.02 * above
}

const wrong = [60, 120, 240].every(rate => limit(4 * MU * MASS * G * rate, MU, rate))
const divided = [60, 120, 240].every(rate => limit(MU * MASS * G, MU / rate / 4, rate))
process.exit(wrong && divided ? 0 : 1)
END
node push.mjs

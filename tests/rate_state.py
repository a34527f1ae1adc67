"""Helpers for rate-and-state friction: scenes, the law as published, slip without inertia."""

import numpy as np

from pyfric import core
from pyfric.scene import Interface, chain, laws
from pyfric.statics import loaded_state

EVOLUTIONS = tuple(laws.EVOLUTIONS)
OWN = {"nagata": {"c": 2.0}}
"""Parameters of single laws."""
RATES = {
    "ageing": lambda x: 1 - x,
    "slip": lambda x: -x * np.log(x),
    "prz": lambda x: 1 - (x / 2) ** 2,
    "nagata": lambda x: 1 - x,
}
"""dtheta/dt as a function of x = |v| theta/D_c, without stress rate."""
LAW = {"a": 0.01, "b": 0.015, "D_c": 1e-5, "f_star": 0.6}


def rated(**changes):
    """Return an interface with this law."""
    alpha = changes.pop("alpha", 0.0)
    law = LAW | OWN.get(changes.get("evolution"), {}) | changes
    return Interface(law=laws.RateAndState(**law), alpha=alpha)


def row(n=4, V=0.1, K=2e4, p=20.0, **changes):
    """Return a chain of n blocks, pushed at V (m/s) by a spring K (N/m)."""
    law = {"v_0": V or None} | changes
    return chain(L=(n - 1) * 2.5e-3, V=V, K=K, p=p, tau=0.0, interface=rated(**law))


def sliding(scene, dt, speeds):
    """Return the state of a chain that slides at these speeds (m/s), pushed by f* times its p."""
    state = loaded_state(scene).state(scene, dt)
    state.y[0, 2], state.mode[:] = speeds, 1
    state.u_drv0 = scene.law.mu_k * scene.F_N / scene.driver.K
    return state


def coefficient(law, v, theta):
    """Return f/p by the published formula, in long double."""
    v, theta = np.longdouble(v), np.longdouble(theta)
    cut = 0 if law.V_c is None else np.longdouble(law.V_star) / np.longdouble(law.V_c)
    psi = np.log(np.longdouble(law.V_star) * theta / np.longdouble(law.D_c) + cut)
    kappa = (np.longdouble(law.f_star) + np.longdouble(law.b) * psi) / np.longdouble(law.a)
    with np.errstate(divide="ignore"):
        q = np.log(np.abs(v) / np.longdouble(law.V_star)) + kappa
    whole = np.where(q > 0, q, 0) + np.log((1 + np.sqrt(1 + 4 * np.exp(-2 * np.abs(q)))) / 2)
    small = np.arcsinh(np.exp(np.minimum(q, 0)) / 2)
    return np.sign(v) * law.a * np.where(q > 0, whole, small)


def slow(scene, start, load, *, load_1=0.0, spring=0.0, variant=None, **how):
    """Return slip without inertia of uncoupled blocks, each on a spring (N/m)."""
    n, state = scene.N_x, loaded_state(scene).state(scene, 1e-7)
    none, p = np.zeros(n), np.where(how.get("closed", np.full(n, True)), 20.0, -20.0)
    limits = {"end": 1.0, "dt": 1e-7, "relative": 1e-10, "u": 1e-18, "log_theta": 1e-10}
    options = "viscous", "inertial", "times", "h", "closed", "threshold", "fast"
    options = {name: how.pop(name) for name in options if name in how}
    return core.slow_slip(
        core.model(scene, "linear", state.u_drv0),
        (np.column_stack([none + load, none + load_1, none]), -np.diag(none + spring)),
        (np.column_stack([p, none, none]), np.zeros((n, n))),
        none + start,
        core.SlowLimits(**limits | how),
        variant=variant or core.VARIANT,
        **options,
    )

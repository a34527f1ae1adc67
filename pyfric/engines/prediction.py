"""Prediction: continuous growth of the slipping zone with mu_s = mu_k, up to sliding.

Source: PRL 107, 074301 (2011), Fig. 2.
"""

from __future__ import annotations

import dataclasses
import math
import time
import warnings
from typing import TYPE_CHECKING

import numpy as np

from pyfric.core import OPEN
from pyfric.engines.quasistatic import QuasistaticRun
from pyfric.signals import at_once
from pyfric.statics import LEAST_DEFINITENESS, bends, one_thread_if_small
from pyfric.values import check_number, naming

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import SceneLike
    from pyfric.statics import Contact


@at_once()
@one_thread_if_small
def prediction_curve(scene: SceneLike, mu: float | None = None) -> Record:
    """Return the growth of the slipping zone with mu_s = mu_k, up to sliding.

    The result is independent of the driver's speed. t is the driver's displacement over V, or over
    1 m/s if it never moves. Protocols are followed. If the driver moves back, blocks slip back.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file. `mu` replaces its
            friction coefficients.
        mu: the friction coefficient; None means the scene's mu_k.

    Returns:
        A record of engine "prediction". Each row of its curve is a change of contact state, with
        columns t (s), F_T (N), drive (m) and L_p_over_L. L_p is the length from the trailing edge
        over which all blocks have slipped or are open. The curve ends when all blocks slip, when no
        further block can slip, or when the solution may not be unique. In the last case the record
        has a note.

    Raises:
        SceneError: mu is not a number >= 0.
        EquilibriumError: no equilibrium was found.

    Warns:
        RuntimeWarning: mu is so large that the solution may not be unique.

    Source: PRL 107, 074301 (2011), Fig. 2.

    >>> curve = pyfric.prediction_curve(pyfric.chain()).curve
    >>> F_T = np.interp(0.5, curve["L_p_over_L"], curve["F_T"])
    >>> round(float(F_T / curve["F_T"].iloc[-1]), 2)  # half the interface slips at half the force
    0.5
    """
    mu = scene.interface.mu_k if mu is None else check_number("mu", mu, "", ge=0.0)
    if (error := bends(scene)) is not None:
        raise error
    V = scene.driver.V if scene.driver.fastest or scene.load_at(0.0) else 1.0
    interface = dataclasses.replace(scene.interface.coulomb(), mu_s=mu, mu_k=mu)
    driver = dataclasses.replace(scene.driver, V=V)
    with naming(where="mu_s = mu_k here"):
        scene = dataclasses.replace(scene, interface=interface, driver=driver)
    run = QuasistaticRun(scene, t_gap=math.inf)  # a pause does not end the event
    _warn_if_ambiguous(run.contact)
    start = time.perf_counter()
    run.sample()
    run.follow(math.inf, lambda: False, lambda *_: None)
    run.timings["path"] = time.perf_counter() - start
    drive = [scene.drive(t) for t in run.history.points()[:, 0].tolist()]
    return run.record("complete", "prediction", drive=drive, L_p_over_L=_reached(run))


def _reached(run: QuasistaticRun) -> list[float]:
    """Return L_p/L at the points of the curve; see `prediction_curve`."""
    run.pass_on()
    scene, order = run.scene, np.argsort(run.scene.n_of_i)
    log, mode, n = run.history.logs(scene.N_x)["switches"], run.mode_0.copy(), 0
    slipped, found = np.zeros(scene.N_x, dtype=bool), []
    for step in run.steps:
        while n < len(log["step"]) and log["step"][n] < step:
            mode[log["block"][n]] = log["new"][n]
            n += 1
        slipped |= np.abs(mode) == 1
        over = (slipped | (mode == OPEN))[order]
        found.append(float(np.logical_and.accumulate(over).sum() / scene.N_x))
    return found


def _warn_if_ambiguous(contact: Contact) -> None:
    """Warn if the solution for slip may not be unique."""
    mu, found = contact.law.mean.mu_k, contact.definiteness_of_sliding()
    if found >= LEAST_DEFINITENESS:
        return
    sure = mu * (1 - LEAST_DEFINITENESS) / (1 - found)  # the definiteness falls linearly in mu
    warnings.warn(
        f"mu = {mu:g}: the solution may not be the only one. If all blocks slip one way, the "
        f"definiteness of the slip operator is {found:.3g}, below {LEAST_DEFINITENESS:g}. The "
        f"curve ends where a second solution appears. Up to mu = {sure:.3g} the solution is unique",
        RuntimeWarning,
        stacklevel=3,
    )

"""Units and meanings of the columns of a record."""

from __future__ import annotations

__all__ = ["LABELS", "describe"]

LABELS: dict[str, tuple[str, str]] = {
    # curve
    "t": ("s", "time"),
    "F_T": ("N", "tangential force of the driver"),
    "weakening_heat": ("J", "friction heat by friction above mu_k p"),
    "viscous_heat": ("J", "friction heat by viscosity of slip"),
    # events
    "t_start": ("s", "time of the first slip"),
    "t_stop": ("s", "time of the last stick"),
    "duration": ("s", "time from first slip to last stick"),
    "F_T_start": ("N", "tangential force of the static equilibrium at first slip"),
    "F_T_arrest": ("N", "tangential force of the static equilibrium at last stick"),
    "F_T_start_inst": ("N", "instantaneous tangential force at first slip"),
    "F_T_arrest_inst": ("N", "instantaneous tangential force at last stick"),
    "first_block": ("1", "lowest block number that slipped, 1 at the trailing edge"),
    "last_block": ("1", "highest block number that slipped, 1 at the trailing edge"),
    "L_p_over_L": ("1", "length slipped or open from the trailing edge, over L"),
    "n_blocks": ("1", "number of distinct blocks that slipped"),
    "nucleation_block": ("1", "number of the block that slipped first, 1 at the trailing edge"),
    "x_nucleation": ("m", "distance of the first slip from the trailing edge"),
    "nucleation_length": ("m", "length at which stable slip loses stability, by static states"),
    "n_episodes": ("1", "number of slip episodes"),
    "n_front": ("1", "number of blocks in the front"),
    "n_not_increasing": ("1", "blocks of the front without speed: times do not increase"),
    "share_X_c0": ("1", "share of the front's blocks with X_c0 >= 6 l, zone at rest"),
    "share_X_c": ("1", "share of the front's blocks with X_c(v) >= 6 l, of those with a speed"),
    "finished": ("1", "slip has stopped and no later episode can join"),
    "is_precursor": ("1", "0 < L_p < L"),
    "is_main": ("1", "at least 4 blocks slipped"),
    "at_trailing_edge": ("1", "first slip at x <= h + l from the trailing edge"),
    "quiet_start": ("1", "row of the quiet table at first slip, -1 for none"),
    "quiet_stop": ("1", "row of the quiet table at last stick, -1 for none"),
    # episodes
    "n": ("1", "block number, 1 at the trailing edge"),
    "i": ("1", "block column, 0 at the left"),
    "step_start": ("1", "time step at the start, -1 for before the log"),
    "step_stop": ("1", "time step at the end, -1 for unfinished"),
    "u_x_start": ("m", "tangential displacement at the start"),
    "u_x_stop": ("m", "tangential displacement at the end"),
    "slip": ("m", "displacement during the episode, positive to the right"),
    "direction": ("1", "direction of slip at the start, +1 to the right"),
    "reversals": ("1", "changes of direction"),
    "corner": ("1", "starts with almost no contact force: not part of any event"),
    "p_start": ("N", "contact force at the start"),
    "event": ("1", "number of the event (row, from 0), -1 for none"),
    # arrays over blocks
    "x": ("m", "position along the interface from the centre of the slider"),
    "region": ("1", "1 slipped in the event, 2 corner slip or open at its end, 0 neither"),
    "rupture_times": ("s", "rupture time of the blocks in the front"),
    "X_c0_over_l": ("1", "blocks in the cohesive zone of a front at rest"),
    "X_c_over_l": ("1", "blocks in the cohesive zone at the speed of the front, below c_R"),
    "drawn_mu_s": ("1", "static friction coefficient as drawn"),
    "drawn_mu_k": ("1", "kinetic friction coefficient as drawn"),
    "drawn_d_c": ("m", "slip over which friction weakens, as drawn"),
    "drawn_alpha": ("N s/m", "viscosity of slip as drawn"),
    "drawn_k_f": ("N/m", "stiffness of the foundation as drawn"),
    "tau_before": ("N", "friction force in the static state at first slip"),
    "p_before": ("N", "contact force in the static state at first slip"),
    "tau_after": ("N", "friction force in the static state at last stick"),
    "p_after": ("N", "contact force in the static state at last stick"),
    "tau_initial": ("N", "friction force at t = 0"),
    "p_initial": ("N", "contact force at t = 0"),
    # logs
    "block": ("1", "block column, 0 at the left"),
    "old": ("1", "contact mode before: 0 stuck, +1 slips right, -1 slips left, 2 open"),
    "new": ("1", "contact mode after"),
    "p": ("N", "contact force"),
    "step": ("1", "time step"),
    "kind": ("1", "+1 slip begins, -1 slip ends (non-corner blocks)"),
    "u_x": ("m", "tangential displacement of the bottom row"),
    "mode": ("1", "contact mode: 0 stuck, +1 slips right, -1 slips left, 2 open"),
}
"""Column or variable -> unit and meaning."""


def describe(name: str, table: str = "") -> tuple[str, str]:
    """Unit and meaning of a column. Unlisted columns of the curve are energies in J."""
    unlisted = ("J" if table == "curve" else "1", name.replace("_", " "))
    return LABELS.get(name, unlisted)

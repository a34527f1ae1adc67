"""Table of all quantities of a record, which file, Dataset, DataTree, CSV and page follow.

Each quantity has a group, a name, dimensions, a type, a unit and a meaning. Columns of events and
arrays over blocks are entered where they are computed (`pyfric.record.catalogue`), by the
decorators `event_column` and `block_array`. All other quantities are entered here.

x is the distance from the trailing edge, the driven side. Events are counted from 1. Arrays run
over blocks from left to right, whichever side is driven.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np
import pandas as pd

from pyfric.scene import LAWS, Term, laws
from pyfric.values import SceneError, usage

P = ParamSpec("P")
T = TypeVar("T")

Find = Callable[[Any], Any]
Enter = Callable[[Find], Find]


class RecordError(ValueError):
    """A file is not a record that this version can read, or a record contradicts itself."""


def check_record(record: Any) -> None:
    """Raise SceneError if the argument is no record, such as a list or the name of a file."""
    if not hasattr(record, "curve"):
        what = record if isinstance(record, str) else type(record).__name__
        allowed = 'one record, of pyfric.simulate(scene, "400 ms") or pyfric.load("run.nc")'
        raise SceneError("record", what, "", allowed, "not a record")


def of_record(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function so that it refuses a first argument that is no record."""

    @usage()
    @functools.wraps(function)
    def called(*args: P.args, **keywords: P.kwargs) -> T:
        check_record(args[0] if args else keywords.get("record"))
        return function(*args, **keywords)

    return called


TABLES = ("curve", "events", "episodes")
LOGS = ("motion", "quiet", "switches", "crossings", "bursts")
"""Groups that are fields of a record: `TABLES` are data frames, `LOGS` are mappings of arrays."""
EDGES = ("tau_initial", "p_initial")
"""Fields of a record that belong to the group "interface"."""


class Held(NamedTuple):
    """One quantity of records.

    Attributes:
        group: one of `GROUPS`.
        name: name of the quantity in its group.
        dims: names of the dimensions.
        dtype: type of the values.
        unit, meaning: texts for readers.
        required: False if some records lack it.
        find: function that computes a column of events or an array over events and blocks. The
            function takes a `Catalogue` if the quantity is required, otherwise a `Record`.
    """

    group: str
    name: str
    dims: tuple[str, ...]
    dtype: np.dtype
    unit: str
    meaning: str
    required: bool = True
    find: Find | None = None

    @property
    def variable(self) -> str:
        """Name of the variable with this quantity in a file."""
        return self.name if self.name in self.dims else GROUPS[self.group] + self.name

    @property
    def labels(self) -> dict[str, str]:
        """Unit and meaning, as attributes of the variable in a file."""
        return {"units": self.unit, "long_name": self.meaning}

    def checked(self, values: Any) -> np.ndarray:
        """Return values, converted to the type of this quantity.

        Raises:
            RecordError: values have gaps, the wrong kind, or the wrong number of dimensions.
        """
        array, where = np.asarray(values), f"record: {self.group}.{self.name}"
        if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
            raise RecordError(f"{where} has masked values, needs numbers without gaps")
        if array.ndim != len(self.dims):
            raise RecordError(f"{where} has {array.ndim} dimensions, needs {len(self.dims)}")
        if array.dtype == self.dtype:
            return array
        if array.dtype.kind not in "biuf" or not np.can_cast(array.dtype, self.dtype):
            raise RecordError(f"{where} holds {array.dtype}, needs {self.dtype}")
        return array.astype(self.dtype)


GROUPS = {
    "curve": "",
    "events": "event_",
    "episodes": "episode_",
    "interface": "",
    "motion": "motion_",
    "quiet": "quiet_",
    "switches": "switch_",
    "crossings": "crossing_",
    "bursts": "burst_",
    "final_state": "final_",
}
"""Groups, and the prefix of the names of their variables in a file."""
_held: dict[str, dict[str, Held]] = {group: {} for group in GROUPS}


def held_in(group: str) -> Mapping[str, Held]:
    """Return the quantities of a group by name, in the order of tables and files."""
    return MappingProxyType(_held[group])


def found_arrays() -> dict[str, Held]:
    """Return the arrays over events and blocks, by name."""
    return {name: held for name, held in held_in("interface").items() if held.find}


def event_column(unit: str, meaning: str, dtype: type = float, **how: bool) -> Enter:
    """Enter the decorated function as a column of the table of events, under its own name.

    The function takes a `Catalogue` and returns one value for each event. With required = False the
    function takes a `Record`, and may return None for no column.
    """
    return _found("events", ("event",), dtype, unit, meaning, **how)


def block_array(unit: str, meaning: str, dtype: type = float) -> Enter:
    """Enter the decorated function as an array over events and blocks, under its own name.

    The function takes a `Catalogue` and returns an array of shape (n_events, N_x), blocks from left
    to right. The array is an attribute of every record.
    """
    return _found("interface", ("event", "x"), dtype, unit, meaning)


def _found(group: str, dims: tuple[str, ...], dtype: type, *said: str, **how: bool) -> Enter:
    def enter(find: Find) -> Find:
        _enter(Held(group, find.__name__, dims, np.dtype(dtype), *said, find=find, **how))
        return find

    return enter


def checked(
    group: str,
    values: Mapping[str, Any] | pd.DataFrame,
    sizes: dict[str, int],
    names: Iterable[str] | None = None,
) -> dict[str, np.ndarray]:
    """Return the arrays of a group, checked, in the order and with the types of records.

    Args:
        group: one of `GROUPS`.
        values: arrays by name.
        sizes: known sizes of dimensions, to which new sizes are added.
        names: names expected; None means the whole group.

    Raises:
        RecordError: an array, named in the message, is missing, unknown, or of the wrong type or
            size.
    """
    known = held_in(group)
    known = known if names is None else {name: known[name] for name in names}
    values = dict(values.items())  # faster than looking up each column of a data frame
    for name in values:
        if name not in known:
            raise RecordError(f"record: no record holds {group}.{name}")
    found = {}
    for name, held in known.items():
        if name in values:
            found[name] = held.checked(values[name])
            for dim, size in zip(held.dims, found[name].shape, strict=True):
                if sizes.setdefault(dim, size) != size:
                    reason = f"has shape {found[name].shape}, needs {sizes[dim]} along {dim}"
                    raise RecordError(f"record: {group}.{name} {reason}")
        elif held.required:
            raise RecordError(f"record: {group}.{name} is missing")
    return found


def table(group: str, columns: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """Return the columns of a group as a table; events are counted from 1."""
    count = len(next(iter(columns.values())))
    events = pd.RangeIndex(1, count + 1, name="event") if group == "events" else None
    return pd.DataFrame(dict(columns), index=events)


def _enter(held: Held) -> None:
    if held.name in _held[held.group]:
        raise ValueError(f"{held.group}.{held.name} is held already")
    _held[held.group][held.name] = held


def counted(*how: str) -> tuple[str, ...]:
    """Return the names of the interface terms with one of these values of `Term.counts`."""
    return tuple(name for name, term in TERMS.items() if term.counts in how)


def _rows(
    group: str, dims: str, variables: Iterable[laws.Variable | Term], drawn: bool = False
) -> str:
    """Return rows of `TABLE` for variables and terms of laws of friction."""
    begin, end = ("drawn_", ", as drawn") if drawn else ("", "")
    return "\n".join(
        f"{group} {dims} {begin}{v.name}? {v.dtype} {v.unit.replace('^', '')} {v.meaning}{end}"
        for v in variables
    )


DRAWN = _rows("interface", "x", (v for law in laws.KINDS.values() for v in law.variables()), True)
MOTION = _rows("motion", "t,x", (v for law in LAWS for v in law.motion))
TERMS: dict[str, Term] = {}
"""Terms of the interface in the energy budget by name; of several laws, the first defines a
name."""
for _law in LAWS:
    for _term in _law.terms:
        TERMS.setdefault(_term.name, _term)
STORED, MOVED = (
    _rows("curve", "t", (TERMS[name] for name in counted(*how)))
    for how in (["stored"], ["given", "lost", "part"])
)
TABLE = f"""
curve     t       t                   f8 s   time
curve     t       F_T                 f8 N   tangential force of the driver
curve     t       kinetic_blocks?     f8 J   kinetic energy of the blocks
curve     t       kinetic_rod?        f8 J   kinetic energy of the rod
curve     t       elastic_bonds?      f8 J   elastic energy of the bonds
curve     t       elastic_foundation? f8 J   elastic energy of the foundation
curve     t       elastic_mattress?   f8 J   elastic energy of the mattress, in a chain of k_top
curve     t       elastic_driver?     f8 J   elastic energy of the driver's spring
{STORED}
curve     t       work_driver?        f8 J   work of the driver's motion
curve     t       work_load?          f8 J   work of the forces on the top, of weights and of pushes
curve     t       dissipated_bonds?   f8 J   heat of the dashpots of the bonds, and radiated
{MOVED}
curve     t       radiated?           f8 J   of the heat of bonds, what absorbing walls took
curve     t       drive?              f8 m   displacement of the driver
curve     t       L_p_over_L?         f8 1   length slipped or open from the trailing edge, over L
episodes  episode n                   i8 1   number of the block, 1 at the trailing edge
episodes  episode i                   i8 1   column of the block, 0 at the left
episodes  episode t_start             f8 s   time at the start
episodes  episode t_stop              f8 s   time at the end, NaN while slip goes on
episodes  episode step_start          i8 1   time step at the start, -1 for before the log
episodes  episode step_stop           i8 1   time step at the end, -1 while slip goes on
episodes  episode u_x_start           f8 m   tangential displacement at the start
episodes  episode u_x_stop            f8 m   tangential displacement at the end
episodes  episode slip                f8 m   displacement meanwhile, positive to the right
episodes  episode direction           i4 1   direction of slip at the start, +1 to the right
episodes  episode reversals           i8 1   changes of direction
episodes  episode corner              ?  1   starts with almost no contact force: in no event
episodes  episode p_start             f8 N   contact force at the start
episodes  episode event               i8 1   number of the event, 0 for none
interface event   event               i8 1   number of the event, from 1
interface x       x                   f8 m   distance from the trailing edge along the interface
interface x       n                   i8 1   number of the block, 1 at the trailing edge
interface x       drawn_mu_s?         f8 1   static friction coefficient as drawn
interface x       drawn_mu_k?         f8 1   kinetic friction coefficient as drawn
interface x       drawn_d_c?          f8 m   slip over which friction weakens, as drawn
interface x       drawn_alpha?        f8 N_s/m viscosity of slip as drawn
interface x       drawn_k_f?          f8 N/m stiffness of the foundation as drawn
interface x       drawn_gap?          f8 m   height over the foundation as drawn
{DRAWN}
interface x       tau_initial         f8 N   friction force at t = 0
interface x       p_initial           f8 N   contact force at t = 0
{MOTION}
motion    t,x     u_x?                f8 m   tangential displacement of the bottom row
motion    t,x     v_x?                f4 m/s tangential velocity of the bottom row
motion    t,x     f?                  f4 N   friction force on the bottom row, positive to the right
quiet     quiet   step                i8 1   time step
quiet     quiet   t                   f8 s   time
quiet     quiet   kind                i4 1   +1 slip begins, -1 slip ends, corner slip left out
quiet     quiet   F_T                 f8 N   tangential force of the driver
quiet     quiet,x u_x                 f8 m   tangential displacement of the bottom row
quiet     quiet   sum_v?              f8 m/s largest |sum of v_x| since slip began
quiet     quiet,x mode                i4 1   contact: 0 stuck, +1/-1 slips right/left, 2 open
switches  switch  step                i8 1   time step
switches  switch  block               i8 1   column of the block, 0 at the left
switches  switch  old                 i4 1   contact before: 0 stuck, +1/-1 slips, 2 open
switches  switch  new                 i4 1   contact after
switches  switch  corner              ?  1   the slip is a corner episode
switches  switch  t                   f8 s   time
switches  switch  u_x                 f8 m   tangential displacement
switches  switch  p                   f8 N   contact force
"""
"""Group, dimensions, name (with "?" if some records lack it), type, unit and meaning."""
for _row in TABLE.strip().splitlines():
    _group, _dims, _name, _dtype, _unit, _meaning = _row.split(maxsplit=5)
    _where = _group, _name.rstrip("?"), tuple(_dims.split(",")), np.dtype(_dtype)
    _enter(Held(*_where, _unit.replace("_", " "), _meaning, required=_name[-1] != "?"))
SAME = ("switches", "crossings"), ("quiet", "bursts")
"""Pairs of groups of the same form: slip by contact, and slip faster than a threshold."""
for _group, _same in SAME:
    for _held_one in tuple(_held[_group].values()):
        _dims = tuple(GROUPS[_same][:-1] if dim != "x" else dim for dim in _held_one.dims)
        _enter(_held_one._replace(group=_same, dims=_dims, required=False))
ENERGIES = tuple(name for name, held in _held["curve"].items() if held.unit == "J")
"""Columns of the energy budget."""
for _group, _name in itertools.product(("quiet", "bursts"), ENERGIES):  # at starts, ends of slip
    _enter(_held["curve"][_name]._replace(group=_group, dims=(GROUPS[_group][:-1],)))

"""A record as file, Dataset, DataTree and tables of text, all from one table (`held`).

A file is netCDF 4, which any netCDF reader opens. `xarray.open_dataset` shows each variable with
its unit and meaning. The attributes of a file are:

``pyfric_schema``
    Version of this layout. Files of other versions are refused.
``scene``
    The scene as TOML text. File names in it are never opened.
``status``
    "complete", "interrupted", "failed: reason", or "ended ..." if an engine could not go on.
``method``, ``versions``, ``timings``, ``counts``, ``notes``, ``errors``
    JSON.

Variables of the curve and of the interface keep their names. Names in the other groups begin with
``event_``, ``episode_``, ``quiet_``, ``switch_``, ``motion_`` and ``final_``. Other programs can
read the types of all variables (`pyfric.record.netcdf`). A loaded record equals the saved record
bit for bit. The attribute ``pyfric_seal`` is the SHA-256 of all variables and of the attributes
that are read. The seal does not change if another program rewrites the file with equal values.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pydantic

from pyfric.core import State, StateError, check_driven
from pyfric.record.data import RecordData
from pyfric.record.held import (
    EDGES,
    GROUPS,
    LOGS,
    TABLES,
    Held,
    RecordError,
    checked,
    found_arrays,
    held_in,
)
from pyfric.record.measured import Errors
from pyfric.record.method import Method
from pyfric.scene import Scene
from pyfric.values import SceneError

if TYPE_CHECKING:
    import xarray as xr

    from pyfric.record.netcdf import Variable

SCHEMA = 12
"""Version of the file layout that this module writes and reads."""
SEAL = "pyfric_seal"
"""Attribute with the SHA-256 of the content of a file."""
DRAWN = "drawn_"
"""Prefix of the names of variables with the drawn random fields of the interface, on x."""
BUDGETS = "curve", "quiet", "bursts"
"""Groups with the energy budget, whose terms depend on the friction law of the scene."""
SHOWN = ("curve", "events", "interface", "motion")
"""Groups of a Dataset: all except logs."""
CSV = {
    ("curve", ("t",)): "curve",
    ("events", ("event",)): "events",
    ("episodes", ("episode",)): "episodes",
    ("interface", ("x",)): "interface",
    ("interface", ("event", "x")): "stresses",
}
"""Names of CSV files, by group and dimensions of the quantities in the file."""


class Texts(pydantic.BaseModel):
    """Attributes of a file that are text, and the types that their JSON holds."""

    scene: str
    status: str
    method: pydantic.Json[Method]
    versions: pydantic.Json[dict[str, str]]
    timings: pydantic.Json[dict[str, float]]
    counts: pydantic.Json[dict[str, int | float]]
    notes: pydantic.Json[tuple[str, ...]]
    errors: pydantic.Json[Errors | None]


TEXTS = tuple(name for name in Texts.model_fields if name not in ("scene", "status"))
"""Attributes that are JSON."""


def held_by(record: RecordData) -> Iterator[tuple[Held, np.ndarray]]:
    """Yield all quantities of a record, in the order of files."""
    scene = record.scene
    coordinates = {
        "event": record.events.index,
        "x": (scene.n_of_i - 1) * scene.slider.l,
        "n": scene.n_of_i,
    }
    edges = {name: getattr(record, name) for name in EDGES}
    groups: dict[str, Mapping[str, Any]] = {n: getattr(record, n) for n in (*TABLES, *LOGS)}
    groups["interface"] = coordinates | edges | _drawn(scene) | record.arrays
    terms = {term.name: term for term in scene.law.terms}
    for group in GROUPS:
        for name, held in held_in(group).items():
            if name in groups[group]:
                if held.group in BUDGETS and name in terms:
                    held = held._replace(meaning=terms[name].meaning)
                yield held, np.asarray(groups[group][name])
    state, law = record.final_state, scene.law
    own = {variable.name: variable for variable in (*law.state, law.margin)}
    for name, value in ({} if state is None else state.values()).items():  # `State` describes it
        values, unit, said = np.asarray(value), "SI", f"{name} of the final state"
        if name in own:
            unit, said = own[name].unit, f"{own[name].meaning}, in the final state"
        dims = tuple(f"final_{name}_{axis}" for axis in range(values.ndim))
        yield Held("final_state", name, dims, values.dtype, unit, said), values


# --- out -----------------------------------------------------------------------------------------


def attributes(record: RecordData) -> dict[str, Any]:
    """Return the attributes of a file."""
    texts = {name: json.dumps(getattr(record, name), default=_plain) for name in TEXTS}
    same = {"scene": record.scene.to_toml(), "status": record.status}
    return {**_titles(record), "pyfric_schema": SCHEMA, **same, **texts}


def _titles(record: RecordData) -> dict[str, str]:
    title = f"pyfric record: {record.scene.name or 'unnamed scene'}"
    return {"title": title, "Conventions": "CF-1.11"}


def _plain(value: Any) -> Any:
    """Return dataclasses and mappings as dicts for JSON."""
    return vars(value) if dataclasses.is_dataclass(value) else dict(value)


def variables(record: RecordData) -> dict[str, Variable]:
    """Return the variables of a file, by name."""
    found = {}
    for held, values in held_by(record):
        beside = {"coordinates": "n"} if "x" in held.dims and held.name != "n" else {}
        found[held.variable] = held.dims, values, held.labels | beside
    return found


def dataset(record: RecordData) -> xr.Dataset:
    """Return curve, events and interface as a Dataset; see `Record.to_xarray`."""
    import xarray as xr  # slow to import

    shown = {
        held.variable: (held.dims, values, held.labels)
        for held, values in held_by(record)
        if held.group in SHOWN
    }
    coordinates = {name: shown.pop(name) for name in ("t", "event", "x", "n")}
    about = {
        **_titles(record),
        "scene": record.scene.to_toml(),
        "method": str(record.method),
        "status": record.status,
        "notes": "\n".join(record.notes),
        "pyfric": record.versions.get("pyfric", ""),
    }
    return xr.Dataset(shown, coordinates, about)


def datatree(record: RecordData) -> xr.DataTree:
    """Return all of a record as a DataTree; see `Record.to_datatree`."""
    import xarray as xr  # slow to import

    groups: dict[str, dict[str, Any]] = {group: {} for group in GROUPS}
    for held, values in held_by(record):
        groups[held.group][held.name] = held.dims, values, held.labels
    root = xr.Dataset(attrs=attributes(record))
    return xr.DataTree.from_dict({"/": root} | {k: xr.Dataset(v) for k, v in groups.items()})


def mat(record: RecordData) -> bytes:
    """Return a MATLAB file: one struct for each group, and one of texts; see `Record.to_mat`."""
    from scipy.io import savemat

    groups: dict[str, dict[str, Any]] = {group: {} for group in GROUPS}
    for held, values in held_by(record):
        groups[held.group][held.name] = values
    about = {"scene": record.scene.to_toml(), "status": record.status}
    about |= {"method": str(record.method), "notes": "\n".join(record.notes)}
    file = io.BytesIO()
    held_groups = {name: group for name, group in groups.items() if group}
    savemat(file, {**held_groups, "about": about}, long_field_names=True, oned_as="column")
    return file.getvalue()


def csv_tables(record: RecordData) -> dict[str, pd.DataFrame]:
    """Return the tables of `Record.to_csv` by name; columns.csv gives units and meanings."""
    known, n = held_in("interface"), record.scene.n_of_i
    events = record.events.index.to_numpy()
    held = [("events", known["event"], events)]
    held += [("stresses", known["event"], np.repeat(events, len(n)))]
    held += [("stresses", known["n"], np.tile(n, len(events)))]
    for what, values in held_by(record):
        if name := CSV.get((what.group, what.dims)):
            held.append((name, what, values.ravel()))
    tables: dict[str, dict[str, Any]] = {name: {} for name in CSV.values()}
    for name, what, values in held:
        tables[name][what.name] = values
    meanings = [(name, what.name, what.unit, what.meaning) for name, what, _ in held]
    tables["columns"] = dict(
        zip(("table", "column", "unit", "meaning"), zip(*meanings, strict=True), strict=True)
    )
    return {name: pd.DataFrame(columns) for name, columns in tables.items()}


def seal(values: Mapping[str, np.ndarray], attributes: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the variables and of the attributes of a file that `load` reads.

    Floats and integers of all sizes count as their 8-byte form.
    """
    found = hashlib.sha256()
    for name in ("pyfric_schema", *Texts.model_fields):
        found.update(f"{name} = {attributes.get(name)}\n".encode(errors="replace"))
    for name in sorted(values):
        array = np.asarray(values[name])
        found.update(f"{name} {array.shape}\n".encode())
        found.update(np.ascontiguousarray(array, "<f8" if array.dtype.kind == "f" else "<i8"))
    return found.hexdigest()


# --- in ------------------------------------------------------------------------------------------


def grouped(values: Mapping[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
    """Return the variables of a file by group and name.

    Raises:
        RecordError: a variable has a name that records do not have.
    """
    known = {held.variable: held for group in GROUPS for held in held_in(group).values()}
    groups: dict[str, dict[str, np.ndarray]] = {group: {} for group in GROUPS}
    for variable, array in values.items():
        if variable in known:
            groups[known[variable].group][known[variable].name] = array
        elif variable.startswith(GROUPS["final_state"]):
            groups["final_state"][variable.removeprefix(GROUPS["final_state"])] = array
        else:
            raise RecordError(f"{variable}: no record holds a variable of this name")
    return groups


def fields(
    attributes: Mapping[str, Any], groups: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the fields of a record from the attributes and groups of a file.

    Raises:
        RecordError: a text, the scene or the state is damaged. The message names the field.
    """
    sizes: dict[str, int] = {}
    interface = checked("interface", groups["interface"], sizes)
    try:
        known = Texts.model_validate(dict(attributes), strict=True)
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise RecordError(f"attribute {where}: {first['msg']}") from None
    scene = _scene(known.scene, interface)
    return {
        **vars(known),
        "scene": scene,
        **{name: checked(name, groups[name], sizes) for name in (*TABLES, *LOGS)},
        "arrays": {name: interface[name] for name in found_arrays()},
        **{name: interface[name] for name in EDGES},
        "final_state": _state(groups["final_state"], scene),
    }


def _scene(text: str, interface: Mapping[str, np.ndarray]) -> Scene:
    """Return the scene of a file, after a check of its drawn fields against the file."""
    try:
        scene = Scene.from_toml(f"{text}\n", files=False)
    except SceneError as error:
        raise RecordError(f"attribute scene: {error}") from None
    if not np.array_equal(interface["n"], scene.n_of_i):
        raise RecordError("n does not number the blocks of the scene from the trailing edge")
    drawn = _drawn(scene)
    for name in drawn.keys() | {name for name in interface if name.startswith(DRAWN)}:
        if not np.array_equal(drawn.get(name), interface.get(name)):
            raise RecordError(f"{name} differs from what the scene draws")
    return scene


def _drawn(scene: Scene) -> dict[str, np.ndarray]:
    """Return the names and values of the drawn fields of a scene, left to right."""
    return {DRAWN + name: np.array(v)[scene.n_of_i - 1] for name, v in scene.drawn.items()}


def _state(values: Mapping[str, np.ndarray], scene: Scene) -> State | None:
    """Return the final state of a record from its variables; None without a state."""
    if not values:
        return None
    plain = {name: v.item() if v.ndim == 0 else v for name, v in values.items()}
    try:
        state = State.of(plain)
        state.check(scene.N_x, scene.N_z)
        check_driven(scene, state.u_drv0)
    except (StateError, TypeError, ValueError, AttributeError, LookupError) as error:
        raise RecordError(f"final_state: {error}") from None
    if state.memory.dtype != scene.law.memory:
        names = ", ".join(scene.law.memory.names or ())
        raise RecordError(f"final_state: its state variables are not those of its law, {names}")
    return state

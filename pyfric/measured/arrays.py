"""Arrays in files of programs: MATLAB, HDF5 and netCDF, NumPy.

netCDF arrays may be packed, with values that stand for gaps. Packed arrays are unpacked by their
attributes (CF conventions, section 8.1), and a note names them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from pyfric.measured.found import Asked, Found, refused

FILLS = {
    **{"i2": -(2**15) + 1, "u2": 2**16 - 1, "i4": -(2**31) + 1, "u4": 2**32 - 1},
    **{"i8": -(2**63) + 2, "u8": 2**64 - 2, "f4": 9.969209968386869e36, "f8": 9.969209968386869e36},
}
"""Default fill values of netCDF, by type."""


def matlab(path: Any, asked: Asked) -> Found:
    """Return the arrays of a MATLAB file up to version 7.2.

    Raises:
        SceneError: the file cannot be read.
    """
    from scipy.io import loadmat  # slow to import

    found = Found("MATLAB")

    def visit(name: str, head: str, value: Any) -> None:
        if isinstance(value, np.ndarray) and value.dtype.names:
            for n, each in enumerate(value.ravel(), 1):
                of = name if value.size == 1 else f"{name}({n})"
                for key in value.dtype.names:
                    visit(f"{of}.{key}", key, each[key])
        elif isinstance(value, np.ndarray):
            found.add_array(name, head, value)

    try:
        content = loadmat(path)
    except Exception as error:  # libraries raise many types of errors
        raise refused(path, "a MATLAB file that can be read", type(error).__name__) from None
    for name, value in content.items():
        if not name.startswith("__"):
            visit(name, name, value)
    return found


def numpy(path: Any, asked: Asked) -> Found:
    """Return the arrays of a file of NumPy, .npy or .npz.

    Raises:
        SceneError: the file cannot be read, or holds Python objects.
    """
    found = Found("NumPy")
    try:
        content = np.load(path, allow_pickle=False)
        arrays = {"array": content} if isinstance(content, np.ndarray) else dict(content)
    except Exception as error:  # libraries raise many types of errors
        raise refused(path, "arrays of numbers", str(error)[:80]) from None
    for name, value in arrays.items():
        for key in value.dtype.names or ():
            found.add_array(f"{name}.{key}", key, value[key])
        found.add_array(name, name, value)
    return found


def hdf5(path: Any, asked: Asked) -> Found:
    """Return the arrays of an HDF5 file, such as netCDF 4 or MATLAB 7.3.

    Raises:
        SceneError: the file cannot be read.
    """
    import h5py  # slow to import

    with open(path, "rb") as file:
        is_matlab = file.read(6) == b"MATLAB"
    found = Found("MATLAB 7.3" if is_matlab else "HDF5")
    try:
        with h5py.File(path, "r") as file:
            default = "_NCProperties" in file.attrs

            def visit(name: str, item: Any) -> None:
                if not isinstance(item, h5py.Dataset):
                    return
                for key in item.dtype.names or ():
                    found.add_array(f"{name}.{key}", key, item[key])
                if item.attrs.get("MATLAB_class", b"") in (b"char", b"cell"):
                    return
                if item.dtype.kind in "iufb" and item.size > 1:
                    values, attrs = item[()], dict(item.attrs)
                    fill = item.id.get_create_plist()
                    if fill.fill_value_defined() == h5py.h5d.FILL_VALUE_USER_DEFINED:
                        attrs.setdefault("_FillValue", item.fillvalue or np.nan)
                    values = _unpacked(found, name, values, attrs, default)
                    head = name.rpartition("/")[2]
                    values = values.T if is_matlab else values
                    found.add_array(name, head, values, _unit(attrs), clock=_scale(item, h5py))

            file.visititems(visit)
    except (OSError, UnicodeDecodeError) as error:
        raise refused(path, "an HDF5 file that can be read", str(error)[:80]) from None
    if is_matlab:
        found.columns = {name.replace("/", "."): c for name, c in found.columns.items()}
    return found


def _scale(item: Any, h5py: Any) -> str | None:
    """Return the name of the dimension of a one-dimensional array, None if it has none."""
    if h5py.h5ds.is_scale(item.id):
        return item.name
    return item.dims[0][0].name if len(item.dims) == 1 and len(item.dims[0]) else None


def netcdf(path: Any, asked: Asked) -> Found:
    """Return the arrays of a classic netCDF file.

    Raises:
        SceneError: the file cannot be read.
    """
    from scipy.io import netcdf_file  # slow to import

    found = Found("netCDF")
    try:
        with netcdf_file(path, "r", mmap=False) as file:
            for name, item in file.variables.items():
                values = np.asarray(item.data)
                if values.dtype.kind in "iufb":
                    values = values.astype(values.dtype.newbyteorder("="))
                    values = _unpacked(found, name, values, item._attributes, True)
                    clock = item.dimensions[0] if len(item.dimensions) == 1 else None
                    found.add_array(name, name, values, _unit(item._attributes), clock=clock)
    except Exception as error:  # libraries raise many types of errors
        raise refused(path, "a netCDF file that can be read", type(error).__name__) from None
    return found


def _unit(attrs: Mapping[str, Any]) -> str:
    """Return the unit among the attributes of an array, "" if there is none."""
    for key in ("units", "unit"):
        for value in np.ravel(attrs[key]) if key in attrs else ():
            if isinstance(value, str | bytes):
                return value.decode() if isinstance(value, bytes) else str(value)
    return ""


def _unpacked(
    found: Found, name: str, values: np.ndarray, attrs: Mapping[str, Any], default: bool
) -> np.ndarray:
    """Return values unpacked by their attributes, and add a note to `found`.

    Args:
        default: whether default fill values of netCDF are gaps.
    """

    def of(key: str) -> list[float]:
        plain = np.ravel(attrs.get(key, ()))
        return plain.tolist() if plain.dtype.kind in "iuf" else []

    if values.dtype.kind == "b":
        return values
    if values.dtype.kind == "i" and re.fullmatch("true", _text(attrs.get("_Unsigned")), re.I):
        values = values.view(values.dtype.str.replace("i", "u"))
    fills = of("_FillValue") + of("missing_value")
    if default and not of("_FillValue") and (kind := values.dtype.str[1:]) in FILLS:
        fills.append(FILLS[kind])
    gaps = np.isin(values, np.array(fills, dtype=values.dtype)) if fills else np.zeros(1, bool)
    ends = of("valid_range")
    low = max([-np.inf, *ends[:1], *of("valid_min")])
    high = min([np.inf, *ends[1:], *of("valid_max")])
    gaps = gaps | (values < low) | (values > high)
    said = [f"{gaps.sum()} samples without a valid value are gaps"] if gaps.any() else []
    if gaps.any():
        values = np.where(gaps, np.nan, values.astype(float))
    for key, apply in (("scale_factor", np.multiply), ("add_offset", np.add)):
        for by in of(key)[:1]:
            values = apply(values, by, dtype=float)
            said.append(f"{key} {by:g}")
    if said:
        found.notes.append(f"{name!r}: {', '.join(said)}")
    return values


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value or "")

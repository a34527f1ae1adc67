"""netCDF 4 files in memory: HDF5 with a scale for each dimension.

xarray takes seven times as long to write one.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

__all__ = ["Variable", "file_image", "read_image"]

Variable = tuple[tuple[str, ...], np.ndarray, dict[str, str]]
"""Dimensions, values and attributes."""

COMPRESSED_FROM = 4096
"""Arrays of at least this many elements are compressed (without loss)."""
NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable. {:10d}"
"""Name, by the format, of the scale of a dimension that no variable is named after."""


def file_image(variables: Mapping[str, Variable], attributes: Mapping[str, Any]) -> bytes:
    """Return the content of a netCDF 4 file: numbers as they are in memory, booleans as int8."""
    import h5py

    sizes = {
        dim: size
        for dims, values, _ in variables.values()
        for dim, size in zip(dims, values.shape, strict=True)
    }
    image = io.BytesIO()
    with h5py.File(image, "w", track_order=True) as file:
        file.attrs.update(attributes)
        made = {name: _made(file, name, *one) for name, one in variables.items()}
        for number, (dim, size) in enumerate(sizes.items()):
            if dim in variables:
                made[dim].make_scale(dim)
            else:
                made[dim] = file.create_dataset(dim, (size,), ">f4")
                made[dim].make_scale(NO_VARIABLE.format(size))
            made[dim].attrs["_Netcdf4Dimid"] = np.int32(number)
        for name, (dims, _, _) in variables.items():
            for axis, dim in enumerate(dims):
                if dim != name:
                    made[name].dims[axis].attach_scale(made[dim])
    return image.getvalue()


def _made(file: Any, name: str, _: Any, values: np.ndarray, attributes: dict[str, str]) -> Any:
    import h5py

    values, kind = np.asarray(values), None
    if values.dtype.kind == "U":
        values, kind = values.astype(object), h5py.string_dtype()
    elif values.dtype.kind == "b":
        values, attributes = values.astype(np.int8), {**attributes, "dtype": "bool"}
    small = values.size < COMPRESSED_FROM or kind is not None
    how = {} if small else {"compression": "gzip", "compression_opts": 1, "shuffle": True}
    made = file.create_dataset(name, data=values, dtype=kind, track_order=True, **how)
    made.attrs.update(attributes)
    return made


def read_image(content: memoryview) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the attributes and the values of all variables of a netCDF 4 file."""
    import h5py

    with h5py.File(h5py.h5f.open_file_image(bytes(content))) as file:
        values = {}
        for name, variable in file.items():
            text = h5py.check_string_dtype(variable.dtype)
            values[name] = np.array(variable.asstr()[()], np.str_) if text else variable[()]
            if variable.attrs.get("dtype") == "bool":
                values[name] = values[name].astype(bool)
        numbers = (np.ndarray, np.generic)
        return {k: v.item() if isinstance(v, numbers) else v for k, v in file.attrs.items()}, values

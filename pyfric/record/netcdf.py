"""netCDF 4 files in memory: HDF5 with a scale for each dimension.

Types belong to netCDF's classic model, which every reader supports. Texts are characters of fixed
length, integers take 32 bits if they fit, and truth values take one byte. The attribute
`_FillValue` marks variables with gaps. `actual_range` has the extremes.

xarray takes seven times as long as this module to write a file. A file to be read may come from an
untrusted source. Only numbers in the file itself are read; links, plugins and other files are
refused.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

Variable = tuple[tuple[str, ...], np.ndarray, dict[str, str]]
"""Dimensions, values and attributes."""

COMPRESSED_FROM = 4096
"""Arrays of at least this many elements are compressed without loss. In smaller arrays, a chunk and
its index take more bytes than compression saves."""
WHOLE = np.int32
"""Type of integers that fit into 32 bits, the longest integers of netCDF's classic model."""
LIBVER = ("v108", "v108")
"""Versions of the file's structures. From 1.8 on, a text may be longer than 64 kB."""
DEFLATE = 1032
"""Largest compression ratio of deflate (zlib). Variables with a larger ratio are refused."""
NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."
"""Name of the scale of a dimension without variable in netCDF; the size follows the name."""


def file_image(variables: Mapping[str, Variable], attributes: Mapping[str, Any]) -> bytes:
    """Return the content of a netCDF 4 file; types are described at the top of this module."""
    import h5py

    sizes = {
        dim: size
        for dims, values, _ in variables.values()
        for dim, size in zip(dims, values.shape, strict=True)
    }
    image = io.BytesIO()
    with h5py.File(image, "w", track_order=True, libver=LIBVER) as file:
        _describe(file, attributes)
        made = {name: _made(file, name, *rest) for name, (_, *rest) in variables.items()}
        for number, (dim, size) in enumerate(sizes.items()):
            if dim in variables:
                made[dim].make_scale(dim)
            else:
                made[dim] = file.create_dataset(dim, (size,), ">f4")
                made[dim].make_scale(f"{NO_VARIABLE} {size:10d}")
            made[dim].attrs["_Netcdf4Dimid"] = np.int32(number)
        for name, (dims, _, _) in variables.items():
            for axis, dim in enumerate(dims):
                if dim != name:
                    made[name].dims[axis].attach_scale(made[dim])
    return image.getvalue()


def _made(file: Any, name: str, values: np.ndarray, attributes: dict[str, str]) -> Any:
    values, said = _simple(np.asarray(values))
    packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
    how = packed if values.size >= COMPRESSED_FROM else {}
    fill = said.get("_FillValue")
    made = file.create_dataset(name, data=values, track_order=True, fillvalue=fill, **how)
    _describe(made, attributes | said)
    return made


def _simple(values: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
    """Return values in a type of netCDF's classic model, and attributes of the values."""
    if values.dtype.kind == "b":
        return values.astype(np.int8), {"dtype": "bool"}
    if values.dtype.kind in "iu" and values.dtype.itemsize > np.dtype(WHOLE).itemsize:
        fits = np.iinfo(WHOLE)
        if not values.size or (values.min() >= fits.min and values.max() <= fits.max):
            values = values.astype(WHOLE)
    said: dict[str, Any] = {}
    finite = values[np.isfinite(values)]
    if finite.size:
        said["actual_range"] = np.array([finite.min(), finite.max()])
    if np.isnan(values).any():
        said["_FillValue"] = values.dtype.type(np.nan)
    return values, said


def _describe(made: Any, attributes: Mapping[str, Any]) -> None:
    """Write attributes: texts as characters, whole numbers in 32 bits."""
    import h5py

    for name, value in attributes.items():
        if isinstance(value, str):
            text = value.encode()
            kind = h5py.string_dtype("utf-8", len(text)) if text else "S1"
            made.attrs.create(name, text if text else h5py.Empty(kind), dtype=kind)
        else:
            made.attrs[name] = WHOLE(value) if isinstance(value, int) else value


def _read(value: Any) -> Any:
    """Return the value of an attribute: text, one number, or an array."""
    import h5py

    if isinstance(value, h5py.Empty):
        return ""
    if isinstance(value, np.ndarray | np.generic) and value.size == 1:
        value = value.item()
    return value.decode() if isinstance(value, bytes) else value


def read_image(content: memoryview) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the attributes and the values of all variables of a netCDF 4 file.

    Raises:
        ValueError: a variable does not hold numbers, or its numbers are not in the file itself.
        OSError: the content is no HDF5 file.
    """
    import h5py

    with h5py.File(h5py.h5f.open_file_image(bytes(content))) as file:
        values: dict[str, np.ndarray] = {}
        attributes = {name: _read(value) for name, value in file.attrs.items()}
        for name in file:
            if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                raise ValueError(f"{name} is a link")
            variable = file[name]
            if not isinstance(variable, h5py.Dataset):
                raise ValueError(f"{name} is no variable")
            label = variable.attrs.get("NAME", b"")
            if not (isinstance(label, bytes) and label.startswith(NO_VARIABLE.encode())):
                values[name] = _numbers(name, variable)
        return attributes, values


def _numbers(name: str, variable: Any) -> np.ndarray:
    """Return the values of a variable, after checks that the values are numbers in this file."""
    import h5py

    how, kind = variable.id.get_create_plist(), variable.dtype.kind
    if kind not in "biuf" or variable.shape is None:
        raise ValueError(f"{name} holds no numbers ({variable.dtype})")
    if how.get_layout() == h5py.h5d.VIRTUAL or how.get_external_count():
        raise ValueError(f"{name} lies in another file")
    known = (h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE)
    if any(how.get_filter(n)[0] not in known for n in range(how.get_nfilters())):
        raise ValueError(f"{name} is stored with filters that records do not use")
    if variable.nbytes > DEFLATE * variable.id.get_storage_size():
        raise ValueError(f"{name} claims more data than the file holds")
    values = variable[()]
    return values.astype(bool) if _read(variable.attrs.get("dtype")) == "bool" else values

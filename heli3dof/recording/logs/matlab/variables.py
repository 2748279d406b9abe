"""Read a MAT file's variables as plain Python values, whatever the file's version.

==========================  ===========================================
MATLAB                      Python
==========================  ===========================================
numbers                     numpy array, without axes of length 1
structure                   dict
array of structures         list of dicts
text                        ``str``
object of a MATLAB class    `Opaque`
==========================  ===========================================

scipy reads versions 4 to 7. Version 7.3 is HDF5, which the optional library h5py reads.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.errors import RecordingError, UsageError
from heli3dof.recording.mcap_files.mcap_scan import read_bytes, what_is

HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Opaque:
    """An object of a MATLAB class, whose content only MATLAB can read."""

    kind: str
    """Name of the class, such as ``timeseries``"""


def read_variables(path: Path) -> dict[str, Any]:
    """Return the variables of a MAT file by name.

    Raises RecordingError for a file that is not readable, and UsageError if h5py is missing.
    """
    data = read_bytes(path)
    is_hdf5 = data.startswith((b"MATLAB 7.3", HDF5)) or data[512:520] == HDF5
    try:
        return _hdf5(path, data) if is_hdf5 else _scipy(data)
    except UsageError:
        raise
    except Exception as error:  # damaged bytes make both libraries raise anything
        raise RecordingError(
            f"{path} is not a readable MAT-file; it is {what_is(data)} ({error}).",
            cause="an incomplete copy, or another kind of file.",
            fix="save it again with save('log.mat', '-v7'), or export the log as CSV",
        ) from error


def _scipy(data: bytes) -> dict[str, Any]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabOpaque

    found: dict[str, Any] = loadmat(io.BytesIO(data), simplify_cells=True)  # type: ignore[arg-type]
    variables: dict[str, Any] = {}
    for name, value in found.items():
        if isinstance(value, MatlabOpaque):
            s0, _, kind, _ = value.reshape(-1)[0]  # name, "MCOS", class, content
            variables[_text(s0)] = Opaque(_text(kind))
        elif not name.startswith("__"):
            variables[name] = value
    return variables


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _hdf5(path: Path, data: bytes) -> dict[str, Any]:
    try:
        import h5py
    except ImportError:
        raise UsageError(
            f"{path} is a MAT-file of version 7.3 (HDF5), which needs h5py.",
            cause="h5py is an optional dependency, because of its size.",
            fix="pip install 'heli3dof[h5py]'; or in MATLAB: S = load('log.mat'); "
            "save('log.mat', '-struct', 'S', '-v7')",
        ) from None

    def value_of(item: Any) -> Any:
        kind = _text(item.attrs.get("MATLAB_class", b""))
        if "MATLAB_object_decode" in item.attrs:
            return Opaque(kind)
        if isinstance(item, h5py.Group):
            return _structure({name: value_of(field) for name, field in item.items()})
        if "MATLAB_empty" in item.attrs:
            return np.empty(0)
        if h5py.check_ref_dtype(item.dtype) is not None:
            values = [value_of(file[reference]) for reference in np.ravel(item[()])]
            return _Elements(values) if kind != "cell" else values
        # MATLAB stores columns first, so HDF5 has the axes in reverse order.
        array = np.squeeze(np.asarray(item).T)
        return "".join(map(chr, np.ravel(array))) if kind == "char" else array

    with h5py.File(io.BytesIO(data), "r") as file:
        names = (name for name in file if not name.startswith("#"))
        return {name: value_of(file[name]) for name in names}


class _Elements(list[Any]):
    """The values of one field in all elements of an array of structures."""


def _structure(fields: dict[str, Any]) -> Any:
    """Return ``fields``, or a list of dicts if they belong to an array of structures."""
    if fields and all(isinstance(values, _Elements) for values in fields.values()):
        return [dict(zip(fields, each, strict=True)) for each in zip(*fields.values(), strict=True)]
    return fields

"""Find the signals and their clocks (time vectors) among a MAT file's variables.

===================================  =========================  ====================================
variable                             signals                    clock
===================================  =========================  ====================================
matrix whose first row is time       the other rows             the first row
matrix without time                  the rows                   another variable
vector                               the vector                 another variable
structure with ``time`` and          the rows of                ``time``
``signals.values``                   ``signals.values``
structure with ``signals.values``,   the rows of                another variable
without ``time``                     ``signals.values``
structure with ``Time``, ``Data``    the rows of ``Data``       ``Time``
other structure                      those of its fields        those of its fields
array of structures                  those of its elements      those of its elements
===================================  =========================  ====================================

- A matrix may also have its signals in columns instead of rows.
- "Another variable" is a vector called ``t_s``, ``time`` or similar (`clock_of`).
- The signals of a variable ``x`` are called ``x[1]``, ``x[2]``, …, or ``x`` if there is only one.
  The labels in ``signals.label`` may replace these names (`_named_signals`).
- The elements of an array ``x`` of structures are called ``x[1]``, ``x[2]``, ….
- A structure may have a text field ``Name`` and exactly one field that is a structure with time.
  Then this text replaces the latter field's name.
- The Simulink block "To File" writes a matrix whose first row is time, and calls it ``ans``. The
  file's name replaces ``ans``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.joined_tables import clock_of
from heli3dof.recording.logs.known_names import rises
from heli3dof.recording.logs.log_validation import MIN_SAMPLES
from heli3dof.recording.logs.matlab.variables import Opaque
from heli3dof.rig.log_columns import KNOWN

UNNAMED = "ans"
LONGEST_TEXT = 60
"""Largest number of characters of a text variable in a message (a convention)"""


@dataclass
class _Found:
    """What a MAT file contains: signals with a clock, other arrays, and ignored variables."""

    clocked: list[tuple[np.ndarray, dict[str, np.ndarray]]] = field(default_factory=list)
    """(clock, {name: signal}) of each structure with time; the clock is a time vector in s"""
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    ignored: list[str] = field(default_factory=list)
    """Names of the ignored variables, each with the reason"""
    paths: dict[str, str] = field(default_factory=dict)
    """Name of an array or timed structure → its full path, such as ``flight.angle.roll``"""

    def with_free_names(
        self, name: str, columns: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Return the ``columns`` of the structure ``name``, with names not used by other signals.

        For example, the column ``roll`` of the structure ``flight`` is renamed to ``flight.roll``
        if another signal is already called ``roll``.
        """
        taken = self.arrays.keys() | {c for _, others in self.clocked for c in others}
        return {f"{name}.{c}" if c in taken else c: values for c, values in columns.items()}

    def columns_by_path(self, columns: Iterable[str]) -> dict[str, str]:
        """Return {full path in the file: column} for those of the ``columns`` that have a path.

        For example, row 1 of the matrix ``x`` in the structure ``flight`` is the column ``x[1]``.
        Its full path is ``flight.x[1]``.
        """
        names = {c: c if c in self.paths else c.rpartition("[")[0] for c in columns}
        return {self.paths[n] + c[len(n) :]: c for c, n in names.items() if n in self.paths}


def tables(source: str, stem: str, variables: Mapping[str, Any]) -> list[Table]:
    """Return one table of signals per time vector.

    Arrays without a time vector form one table per array length. ``source``: the file's name;
    ``stem``: the file's name without its ending; ``variables``: the file's variables by name.
    """
    found = _Found()
    for name, value in variables.items():
        name = stem if name == UNNAMED else name
        _visit(name, name, value, found)
    clocked = list(_by_clock(found))
    lengths = {len(next(iter(columns.values()))) for columns in clocked}
    groups = [*clocked, *_without_clock(found, lengths)]
    return [
        Table(
            source,
            columns,
            lambda k: f"sample {k + 1}",
            ignored=[] if i else found.ignored,
            paths=found.columns_by_path(columns),
        )
        for i, columns in enumerate(groups)
    ]


def _visit(name: str, path: str, value: Any, found: _Found) -> None:
    """Add the signals of a variable of the file, or of a structure's field, to ``found``.

    ``value``: content of the variable or field; ``path``: its full path in the file, such as
    ``flight.angle.roll``; ``name``: the name of its signals. If ``value`` is a structure without
    own signals, the function calls itself for each field. The ``name`` of a field is the first of
    these names that is not used yet: the field's name, ``structure.field``, the full path.
    """
    if isinstance(value, Opaque):
        found.ignored.append(
            f"{name}: an object of the MATLAB class {value.kind}. In MATLAB: {name} = "
            f"struct('Time', {name}.Time, 'Data', {name}.Data), then save again"
        )
    elif isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value):
        for i, element in enumerate(value, 1):
            _visit(f"{name}[{i}]", f"{path}[{i}]", element, found)
    elif isinstance(value, Mapping):
        if (timed := _timed_structure(name, value)) is not None:
            t, columns = timed
            found.clocked.append((t, found.with_free_names(name, columns)))
            found.paths[name] = path
            return
        if (untimed := _structure_without_time(name, value)) is not None:
            found.arrays |= found.with_free_names(name, untimed)
            found.paths[name] = path
            return
        label = next((v for key, v in value.items() if key.lower() == "name"), None)
        with_time = [key for key, inner in value.items() if _has_time(inner)]
        for key, inner in value.items():
            own = label if isinstance(label, str) and label and with_time == [key] else key
            full = f"{path}.{key}"
            free = (n for n in (own, f"{name}.{own}") if n not in found.paths)
            _visit(next(free, full), full, inner, found)
    else:
        array = np.squeeze(np.asarray(value))
        if array.dtype.kind not in "fiub" or array.ndim > 2 or max(array.shape, default=0) < 2:
            where = path if isinstance(value, str) else name
            found.ignored.append(f"{where}: {_described(value)}")
        else:
            found.arrays[name] = array.astype(float)
            found.paths[name] = path


def _timed_structure(
    name: str, value: Mapping[str, Any]
) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """Return time vector and columns of a structure; None if it contains no time vector."""
    fields = _fields(value)
    t = np.asarray(fields.get("time", ()))
    if t.ndim != 1 or len(t) < MIN_SAMPLES:
        return None
    if "data" in fields:
        return t.astype(float), dict(_rows(name, np.asarray(fields["data"], float), len(t)))
    if "signals" not in fields:
        return None
    return t.astype(float), _named_signals(name, fields["signals"], len(t))


def _structure_without_time(name: str, value: Mapping[str, Any]) -> dict[str, np.ndarray] | None:
    """Return the columns of a structure with ``signals.values``, but without time; else None.

    The block "To Workspace" writes it (format "Structure"), with an empty ``time``.
    """
    fields = _fields(value)
    if np.size(fields.get("time", ())) or "signals" not in fields:
        return None
    signals = fields["signals"]
    first = signals if isinstance(signals, Mapping) else next(iter(signals), None)
    if not isinstance(first, Mapping) or "values" not in first:
        return None
    return _named_signals(name, signals, max(np.shape(first["values"]), default=1))


def _has_time(value: Any) -> bool:
    return isinstance(value, Mapping) and _timed_structure("", value) is not None


def _fields(value: Mapping[str, Any]) -> dict[str, Any]:
    return {key.lower(): inner for key, inner in value.items()}


def _named_signals(name: str, signals: Any, n: int) -> dict[str, np.ndarray]:
    """Return the signals of a structure's field ``signals`` as a dict: name → column (n,).

    ``name``: the structure's name. ``signals`` is a structure or a list of structures. Each has
    ``values``, which contain one or more columns, and may have a ``label``.

    If the list has several structures with different labels, their columns are named after the
    labels. Otherwise all columns are named after the structure. A name gets the numbers [1], [2], …
    if it has several columns.
    """
    listed = [signals] if isinstance(signals, Mapping) else list(signals)
    blocks = [_as_rows(np.asarray(s["values"], dtype=float), n) for s in listed]
    labels = [str(s.get("label", "")) if np.size(s.get("label", "")) else "" for s in listed]
    if len(set(labels)) < len(labels) or not all(labels) or len(labels) == 1:
        return dict(_rows(name, np.concatenate(blocks), n))
    columns: dict[str, np.ndarray] = {}
    for label, block in zip(labels, blocks, strict=True):
        columns |= dict(_rows(label, block, n))
    return columns


def _by_clock(found: _Found) -> Iterator[dict[str, np.ndarray]]:
    """Yield one dict per time vector: its signals by name, and the vector itself as ``t_s``.

    Removes the arrays of these signals from ``found``.
    """
    for t, columns in found.clocked:
        yield {"t_s": t, **columns}
    name = clock_of(found.arrays)
    if name is not None and found.arrays[name].ndim == 1:
        t = found.arrays[name]
        joined: dict[str, np.ndarray] = {}
        for other, array in list(found.arrays.items()):
            if len(t) in array.shape:
                block = _as_rows(found.arrays.pop(other), len(t))
                if len(block) > 1 and np.array_equal(block[0], t):
                    block = block[1:]
                joined |= dict(_rows(other, block, len(t)))
        yield joined
    for other, array in list(found.arrays.items()):
        if array.ndim == 2 and max(array.shape) >= MIN_SAMPLES:
            block = _as_rows(array, max(array.shape))
            if rises(block[0]):
                del found.arrays[other]
                yield {"t_s": block[0], **dict(_rows(other, block[1:], block.shape[1]))}


def _without_clock(found: _Found, clocks: set[int]) -> Iterator[dict[str, np.ndarray]]:
    """Yield one dict per array length: the columns of the arrays in ``found`` without time vector.

    ``clocks``: lengths of the file's time vectors. The function keeps every array whose name
    docs/reference/recording.md lists. It ignores any other array in two cases:

    - The array has fewer than `MIN_SAMPLES` samples.
    - The file has time vectors, and none of them has the array's length.
    """
    lengths: dict[int, dict[str, np.ndarray]] = {}
    for name, array in found.arrays.items():
        n = next((n for n in array.shape if n in clocks), max(array.shape))
        if name not in KNOWN and (n < MIN_SAMPLES or (clocks and n not in clocks)):
            found.ignored.append(f"{name}: {_described(array)}")
        else:
            lengths.setdefault(n, {}).update(_rows(name, array, n))
    yield from lengths.values()


def _rows(name: str, block: np.ndarray, n: int) -> Iterator[tuple[str, np.ndarray]]:
    rows = _as_rows(block, n)
    for i, row in enumerate(rows, 1):
        yield (name if len(rows) == 1 else f"{name}[{i}]"), np.ascontiguousarray(row)


def _as_rows(block: np.ndarray, n: int) -> np.ndarray:
    """Return an array of n samples as (signals, n); time may be its first or its last axis."""
    if block.ndim == 1:
        return block[np.newaxis]
    if block.shape[-1] == n:
        return block.reshape(-1, n)
    return block.reshape(n, -1).T


def _described(value: Any) -> str:
    """Return why a variable is ignored: ``one value``, ``3 × 3 values``, ``text 'elev'``."""
    if isinstance(value, str):
        return f"text {value[:LONGEST_TEXT]!r}"
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        kinds = {"U": "text", "c": "complex numbers"}
        return kinds.get(array.dtype.kind, "not numeric")
    return "one value" if array.size == 1 else " × ".join(map(str, array.shape)) + " values"

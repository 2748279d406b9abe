"""`preview`: describes what an import reads from a log, before heli3dof writes a recording."""

from __future__ import annotations

from typing import Any

import numpy as np

from heli3dof.recording.columns import unit_of
from heli3dof.recording.logs.importer import Table
from heli3dof.rig.log_columns import KNOWN, ORDERED


def preview(table: Table) -> dict[str, Any]:
    """Return a JSON-able dictionary: a log's columns, channels, clock, ignored columns and notes.

    Each column has ``name``, ``source`` (the log's column or expression), ``unit``, and ``first``,
    ``min`` and ``max`` of its values. ``period_s`` is the median interval of ``t_s``.
    """
    t = table.columns.get("t_s")
    names = [name for name in ORDERED if name in table.columns]
    return {
        "source": table.source,
        "samples": len(table),
        "start_s": float(t[0]) if t is not None and len(t) else None,
        "period_s": float(np.median(np.diff(t))) if t is not None and len(t) > 1 else None,
        "columns": [_column(table, name) for name in names],
        "channels": [_column(table, name) for name in table.columns if name not in KNOWN],
        "ignored": list(table.ignored),
        "notes": list(table.notes),
    }


def _column(table: Table, name: str) -> dict[str, Any]:
    values = table.columns[name]
    finite = values[np.isfinite(values)]
    return {
        "name": name,
        "source": table.origins.get(name, name),
        "unit": unit_of(name),
        "first": float(values[0]) if len(values) else None,
        "min": float(finite.min()) if len(finite) else None,
        "max": float(finite.max()) if len(finite) else None,
    }

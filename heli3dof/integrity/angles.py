"""Check that angles are in radians and on the grid of the profile's encoder.

An encoder with N counts per revolution reads multiples of 2π/N rad, its grid. If an angle is on the
grid of an encoder with another N, the check reports bad data: the controller and the noise model of
a diagnosis use the N in the profile. If an angle is on no grid, the check reports only a note (the
mildest kind of fault), because the log may contain filtered or simulated angles.

The check ``encoder.counts`` may report that an angle is wrong by a factor. In this case `grids`
does not report another encoder's grid, because the corrected angle has a different grid.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.errors import RecordingError
from heli3dof.integrity import scale
from heli3dof.integrity.base import Check, Fault, Kind, Stage, bad_data_fault
from heli3dof.integrity.jump import FEW, deviations
from heli3dof.integrity.view import View
from heli3dof.recording.logs import angle_units


def angles(view: View) -> Iterable[Fault]:
    """Yield a fault for each angle in degrees, in counts, or too small by a factor π/180."""
    r, rows = view.recording, view.finite_rows
    for i in _axes_to_check(view):
        axis, q = AXES[i], r.angle[rows, i]
        if np.abs(q).max() > 10 and angle_units.on_grid(q, 1.0, levels=10):
            counts = abs(int(getattr(r.profile.encoder, axis)))
            yield Fault(
                "angle.unit", Kind.BAD_DATA, r.name,
                f"{r.name}: {axis} contains whole numbers up to {np.abs(q).max():.6g}.",
                f"raw encoder counts ({counts} per revolution) instead of an angle.",
                f"multiply by {360 / counts:.6g}° (and the encoder's sign)", axis=axis,
            )  # fmt: skip
            continue
        columns = {f"v_{m}_V": r.voltage[rows, k] for k, m in enumerate(MOTORS)}
        columns["t_s"] = r.t[rows]
        ref = r.reference[rows, i]
        if np.isfinite(ref).all():
            columns[f"{axis}_ref_rad"] = ref
        # The log may have named either unit: the values must pass the test under both names.
        for name, values in ((f"{axis}_rad", q), (f"{axis}_deg", np.degrees(q))):
            try:
                angle_units.check_angles(r.name, {**columns, name: values}, r.profile)
            except RecordingError as error:
                yield bad_data_fault("angle.unit", view, error, axis)
                break


def grids(view: View) -> Iterable[Fault]:
    """Yield a fault for each axis whose angles are not on the grid of the profile's encoder.

    The grid of an encoder with N counts per revolution consists of the multiples of 2π/N rad. The
    fault is of the most severe kind, `Kind.BAD_DATA`, if the angles are on the grid of an encoder
    with another N. It is of the mildest kind, `Kind.NOTE`, if they are on no such grid.
    """
    r = view.recording
    for i in _axes_to_check(view):
        axis, q = AXES[i], r.angle[view.finite_rows, i]
        in_profile = int(getattr(r.profile.encoder, axis))
        counts = abs(in_profile)
        fitted = counts if np.ptp(q) == 0 else angle_units.counts_seen(q, "rad", counts)
        if fitted is None:
            yield Fault(
                "encoder.grid", Kind.NOTE, r.name,
                f"{r.name}: {axis} does not lie on the encoder's grid of {360 / counts:.4f}°.",
                "filtering, resampling, printing with few digits, or a simulation without encoder.",
                "log the angles as the encoder reads them", axis=axis,
            )  # fmt: skip
        elif fitted != counts and not any(
            f.kind == Kind.BAD_DATA for f in scale.counts(view) if f.axis == axis
        ):
            yield Fault(
                "encoder.grid", Kind.BAD_DATA, r.name,
                f"{r.name}: {axis} lies on a grid of {fitted:.6g} counts per revolution; the "
                f"profile has {counts}.",
                "another encoder, or edges counted once or twice instead of four times.",
                f"set encoder.{axis} = {np.copysign(fitted, in_profile):.6g} in the profile if the "
                "angles are right", axis=axis, confidence=0.99,
            )  # fmt: skip


def _axes_to_check(view: View) -> list[int]:
    """Return the indices of the axes that `angles` and `grids` check.

    A jump is a change of the angle between two rows that is too large for a real motion. An axis
    with 1 to `FEW` jumps is left out: only a few rows are faulty, but the test of the unit would
    report a wrong unit. An axis with more jumps is checked, because a wrong unit makes many changes
    too large. The list is empty if fewer than 20 rows have finite values.
    """
    if view.finite_rows.sum() < 20:
        return []
    return [i for i in view.measured if not 0 < len(deviations(view, i)[1]) <= FEW]


CHECKS = (
    Check("angles", Stage.VALUES, "degrees, radians, counts", angles, ("angle.unit",)),
    Check("encoder.grid", Stage.MOTION, "another encoder's grid", grids),
)

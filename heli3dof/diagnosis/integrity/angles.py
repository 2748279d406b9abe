"""Are the angles radians, and counts of the profile's encoder?

The grid is the strongest witness (`heli3dof.recording.logs.angle_units`): an encoder of N counts
steps by 2π/N rad. Here every recording passes it, flights too; imported logs have passed it once.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage, refused
from heli3dof.diagnosis.integrity.jump import FEW, leaps
from heli3dof.diagnosis.integrity.view import View
from heli3dof.errors import RecordingError
from heli3dof.recording.logs import angle_units


def angles(view: View) -> Iterable[Fault]:
    """Per axis its unit, and where that is right its grid."""
    if view.read.sum() < 20:
        return
    for i in view.measured:
        if 0 < len(leaps(view, i)[1]) <= FEW:
            continue  # a jump looks like motion that no voltage explains, whatever the unit
        found = [*unit(view, i)]
        yield from found or grid(view, i)


def unit(view: View, i: int) -> Iterable[Fault]:
    """Degrees or counts taken for radians, radians for degrees, on the axis of that index."""
    r, rows = view.recording, view.read
    axis, q = AXES[i], r.angle[rows, i]
    if np.abs(q).max() > 10 and angle_units.on_grid(q, 1.0, levels=10):
        counts = abs(int(getattr(r.profile.encoder, axis)))
        yield Fault(
            "angle.unit", Kind.BAD_DATA, r.name,
            f"{r.name}: {axis} contains whole numbers up to {np.abs(q).max():.6g}.",
            f"raw encoder counts ({counts} per revolution) instead of an angle.",
            f"multiply by {360 / counts:.6g}° (and the encoder's sign)", axis=axis,
        )  # fmt: skip
        return
    columns = {f"v_{m}_V": r.voltage[rows, k] for k, m in enumerate(MOTORS)}
    columns["t_s"] = r.t[rows]
    ref = r.reference[rows, i]
    if np.isfinite(ref).all():
        columns[f"{axis}_ref_rad"] = ref
    # The arrays are radians: whichever unit the file called them, the name must fit.
    for name, values in ((f"{axis}_rad", q), (f"{axis}_deg", np.degrees(q))):
        try:
            angle_units.check_angles(r.name, {**columns, name: values}, r.profile)
        except RecordingError as error:
            yield refused("angle.unit", view, error, axis)
            return


def grid(view: View, i: int) -> Iterable[Fault]:
    """Angles that lie on another encoder's grid, or on none. Whether they are also too large or
    too small is told by the motion (``encoder.counts``)."""
    r, axis = view.recording, AXES[i]
    q = r.angle[view.read, i]
    counts = abs(int(getattr(r.profile.encoder, axis)))
    seen = counts if np.ptp(q) == 0 else angle_units.counts_seen(q, "rad", counts)
    if seen is None:
        yield Fault(
            "encoder.grid", Kind.NOTE, r.name,
            f"{r.name}: {axis} does not lie on the encoder's grid of {360 / counts:.4f}°.",
            "filtering, resampling, printing with few digits, or a simulation without encoder.",
            "log the angles as the encoder reads them", axis=axis,
        )  # fmt: skip
    elif seen != counts:
        yield Fault(
            "encoder.grid", Kind.NOTE, r.name,
            f"{r.name}: {axis} lies on a grid of {seen:.6g} counts per revolution; the profile "
            f"has {counts}.",
            "another encoder, or edges counted once or twice instead of four times.",
            f"set encoder.{axis} = {seen:.6g} in the profile if the angles are right",
            axis=axis,
        )  # fmt: skip


CHECKS = (
    Check("angles", Stage.VALUES, "degrees, radians, counts; another encoder's grid", angles),
)

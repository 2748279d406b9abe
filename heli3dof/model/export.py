"""`export`: writes a recording or a model in the format of another program.

A model becomes a state-space model for MATLAB and Octave (version 5 MAT file)::

    x[k+1] = A x[k] + B (V[k] − u0_V)        y[k] = C x[k] + D (V[k] − u0_V) + y0_rad

V are the voltages in V (front, back), y the angles in rad of the model's axes. The operating point
of the model has the voltages u0_V and the angles y0_rad. D is zero. The variable Ts is the sample
interval in s. The variables Ac, Bc, Cc, Dc are the same model in continuous time. A nonlinear model
is linearised at level hover.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from heli3dof.errors import UsageError, quoted
from heli3dof.model.base import Model
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.linear.model import LinearModel
from heli3dof.model.model_file import read_model
from heli3dof.recording.atomic_write import write_file
from heli3dof.recording.load import load
from heli3dof.recording.logs import export as recordings
from heli3dof.recording.recording import Recording

STATE_UNITS = {"r": "rad", "p": "rad", "psi": "rad", "F_front": "N", "F_back": "N"}


def export(
    source: Recording | Model | str | Path, path: str | Path, *, force: bool = False
) -> Path:
    """Write a recording or a model in the format of the file name's ending; return the path.

    ``source``: the recording or model, or the path of its file (a model's ends in ``.json``).

    A recording becomes a table (``.csv``, ``.csv.gz``, ``.mat``, ``.parquet``) or a viewer's file
    (``.mcap``, ``.rrd``, ``.xml``); a model becomes a state-space model for MATLAB (``.mat``).

    Raises OutputExists (without ``force``), UsageError (unknown ending; the library for Parquet or
    Rerun is not installed; ``source`` is another object), NoSpace, or CheckFailed if a nonlinear
    model cannot hover level.
    """
    if isinstance(source, str | Path):
        source = read_model(source) if Path(source).suffix.lower() == ".json" else load(source)
    if isinstance(source, Recording):
        return recordings.export(source, path, force=force)
    if not isinstance(source, GreyBoxModel | LinearModel):
        raise UsageError(
            f"source is of the type {type(source).__name__}, not a recording or a model.",
            cause="another object was passed; a profile is saved by save_profile.",
            fix="export(flight.recording, 'flight.csv'), or export(identified.model, 'model.mat')",
        )
    check_model_format(Path(path))
    from scipy.io import savemat

    out = io.BytesIO()
    savemat(out, variables(source), oned_as="column")  # type: ignore[arg-type]
    return write_file(path, out.getvalue(), force=force)


def check_model_format(path: Path, source: Path = Path("MODEL.json")) -> None:
    """Raise UsageError unless ``path`` ends in ``.mat``; ``source`` is the model's file."""
    if path.suffix.lower() != ".mat":
        raise UsageError(
            f"A model can be exported as .mat only, not as {path.name}.",
            cause="the other formats are tables of a recording, or viewers of one.",
            fix=f"heli3dof export {quoted(source)} -o {quoted(path.stem)}.mat",
        )


def variables(model: Model) -> dict[str, object]:
    """Return the variables of a model's MAT file by name; lists of texts are cell arrays.

    ``K`` (n, axes), per rad, is the Kalman gain of the innovation form; zero without a noise model.
    ``continuous_by`` states how Ac … Dc were computed: ``hold`` (exact) or ``bilinear``. With
    ``bilinear``, the states of the continuous model are linear combinations of those in
    ``state_names`` and the voltages.
    """
    linear = model.linear() if isinstance(model, GreyBoxModel) else model
    assert isinstance(linear, LinearModel)  # the only other form of a model
    sampled, continuous = model.to_control(), linear.continuous()
    there = linear.modelled
    states, outputs = sampled.state_labels, np.array(sampled.output_labels)[there]
    return {
        "A": linear.A,
        "B": linear.B,
        "C": linear.C[there],
        "D": np.zeros((int(there.sum()), 2)),
        "K": linear.K[:, there],
        "Ts": linear.dt,
        "Ac": continuous.A,
        "Bc": continuous.B,
        "Cc": continuous.C[there],
        "Dc": continuous.D[there],
        "continuous_by": continuous.method,
        "u0_V": linear.u0,
        "y0_rad": linear.y0[there],
        "state_names": _cells(states),
        "state_units": _cells([unit_of_state(name) for name in states]),
        "input_names": _cells(sampled.input_labels),
        "input_units": _cells(["V", "V"]),
        "output_names": _cells(outputs),
        "output_units": _cells(["rad"] * len(outputs)),
        "name": model.name,
        "kind": model.kind,
    }


def unit_of_state(name: str) -> str:
    """Return a state's unit; an empty text for the states of a black-box model.

    >>> unit_of_state("psi_rate"), unit_of_state("v_front_delayed_1"), unit_of_state("x[0]")
    ('rad/s', 'V', '')
    """
    if name.endswith("_rate"):
        return "rad/s"
    return "V" if name.startswith("v_") else STATE_UNITS.get(name, "")


def _cells(texts: Sequence[str] | np.ndarray) -> np.ndarray:
    return np.array([str(t) for t in texts], dtype=object)

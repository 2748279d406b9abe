"""Runs heli3dof's methods, each in its own process like the other tools.

``python -m tests.bench.peers.ours METHOD FLIGHT.mcap HELD_OUT.mcap FOUND.npz``. The measured time
is that of the fit, as for the others:

- black box: the whole of `identify`, because it selects the order and the sample interval
- grey box: `fit_greybox`, from the recording to intervals and bounds, without the scores on
  held-out data that `identify` adds

Machine code is compiled before: the benchmark first runs every method once without measuring.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.bench.peers import rigid
from tests.bench.peers.interface import Meter, write_exact, write_physical

PHYSICAL = dict(
    zip(
        rigid.NAMES,
        (
            "J_roll", "J_pitch", "J_yaw", "T_g",
            "stiffness.pendulum.roll.torque_Nm", "stiffness.pendulum.pitch.torque_Nm",
            "friction.viscous.roll.damping_Nms_per_rad",
            "friction.viscous.pitch.damping_Nms_per_rad",
            "friction.viscous.yaw.damping_Nms_per_rad",
            "motor.lag.time_constant_s",
        ),
        strict=True,
    )
)  # fmt: skip
"""The grey box's names of the ten parameters; it also fixes K_f at its nominal value"""


def main(method: str, flight_file: str, held_out_file: str, found_file: str) -> None:
    from heli3dof.identification.identify import identify
    from heli3dof.model.model_file import save_model
    from heli3dof.recording.mcap_files.reader import read_recording

    flight = read_recording(flight_file)
    held_out = read_recording(held_out_file)
    meter = Meter()
    if method == "greybox":
        from heli3dof.identification.greybox.method import fit_greybox

        with meter.fitting():
            fit_greybox(flight)
        result: Any = identify(flight, method=method, holdout=held_out)
    else:
        with meter.fitting():
            result = identify(flight, method=method, holdout=held_out)
    results = Path(found_file)
    document = result.to_dict()
    if "parameters" in document:
        values, stds = ten_parameters(document["parameters"])
        file = save_model(result.model, results.with_suffix(".json"), force=True)
        setting = f"identify(method={method!r}), every {result.interval_s * 1e3:g} ms"
        write_physical(results, meter, setting, values, stds, model_file=str(file))
        return
    m = result.model
    poles = [[p.value.real, p.value.imag, p.std_real, p.std_imag] for p in result.poles]
    write_exact(
        results, meter,
        f"identify(method={method!r}), order {m.order}, every {result.interval_s * 1e3:g} ms",
        A=m.A, B=m.B, C=m.C, K=m.K, S=m.S, u0=m.u0, y0=m.y0, poles=np.array(poles),
    )  # fmt: skip


def ten_parameters(
    document: Mapping[str, Any] | Sequence[Mapping[str, Any]],
) -> tuple[np.ndarray, np.ndarray]:
    """Returns (values, standard deviations), each (10,), in the order of `rigid.NAMES`.

    ``document``: ``parameters`` of ``identify --json``, a mapping by name or a list. A parameter
    that the fit excluded is zero, as in the model; a missing standard deviation is NaN.
    """
    if not isinstance(document, Mapping):
        document = {str(p.get("parameter", p.get("name"))): p for p in document}
    result = [document.get(PHYSICAL[name], {"value": 0.0}) for name in rigid.NAMES]
    values = np.array([float(p["value"]) for p in result])
    stds = [p.get("std") for p in result]
    return values, np.array([np.nan if s is None else float(s) for s in stds])


if __name__ == "__main__":
    main(*sys.argv[1:])

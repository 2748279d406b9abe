"""Measures closed-loop replays of a real rig, whose logs do not contain their controller."""

from __future__ import annotations

import numpy as np

import heli3dof as h3
from heli3dof.identification.greybox.freeflight import fit_freeflight, model_of
from tests.bench import Figure
from tests.paths import REAL_DATA

TITLE = "Closed-loop replay of real recordings"
INTRO = """
RMSE of the simulated flight, from rest on the table to the end of the log. The controller is
identified from the log. The grey box is fitted to the other logs. Measured only on machines with
the recordings.
"""
RIG = "rig-a"
LOGS = ("closed-1a", "closed-2a", "closed-1b")
REPLAYED = LOGS[:2]
"""The logs that contain references"""


def measure() -> list[Figure]:
    if not REAL_DATA.is_dir():
        return []
    profile = h3.load_profile(REAL_DATA / RIG / "profile.toml")
    logs = {n: h3.load(REAL_DATA / RIG / f"{n}.csv", profile) for n in LOGS}
    return [f for name in REPLAYED for f in replays(profile, logs, name)]


def replays(profile: h3.Profile, logs: dict[str, h3.Recording], name: str) -> list[Figure]:
    """Returns the replay errors of the hover model and of the grey box on one log."""
    train = [r for n, r in logs.items() if n != name]
    models = [h3.hover_model(profile), model_of(fit_freeflight(train), train, "grey box")]
    compared = h3.compare([logs[name]], models, horizons_s=(), identify_controller=True)
    (flight,) = compared.flights
    law = flight.flown.identified_controller
    assert law is not None
    how = (
        f"roll / pitch / yaw; {flight.flown.duration:.0f} s; the identified controller is of order "
        f"{len(law.A)} and leaves {100 * law.share:.2g} % of the voltages' changes unexplained"
    )
    return [
        Figure(
            f"{RIG}, {name}: {m.name}, closed-loop replay",
            " / ".join(f"{e:.2f}" for e in np.array(m.replay_rmse_deg)) + " °",
            how=how,
        )
        for m in flight.models
    ]

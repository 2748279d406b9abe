"""Flights with an effect outside the catalogue: the proposed formula, and the share of the gain.

The true term of the effect (`heli3dof.model.effects.empirical`) is fitted to the same flight, and
its decrease of the prediction error on held-out data compared with that of the diagnosis.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.diagnosis.conclusion.torque_terms import fit_with
from heli3dof.diagnosis.diagnose import FULL
from heli3dof.diagnosis.unmodelled.torque_formula import Proposal
from heli3dof.diagnosis.validation.cross_validation import held_out
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.model.control.voltage_replay import with_known_controller
from heli3dof.recording.logs.sampling_clock import sampling_times
from heli3dof.recording.recording import Recording
from tests.bench import Figure
from tests.hidden.run import FOLDER, run
from tests.hidden.sizes import OUTSIDE, axis_of
from tests.hidden.tally import Judged, Rate
from tests.hidden.third_plant.effects import OUTSIDE as THIRD_OUTSIDE
from tests.hidden.tools import TOOLS, Tool

PRODUCTS = {
    "other.yaw_torque_from_pitch_rate": "pitch_rate",
    "other.roll_torque_from_yaw_angle": "sin(yaw)",
    "other.pitch_torque_from_voltage_product": "voltage_front*voltage_back",
    "other.yaw_torque_from_roll_rate_squared": "abs(roll_rate)*roll_rate",
    **THIRD_OUTSIDE,
}
"""Hidden effect → product of the true torque"""
START = 0.01
"""Coefficient at which the fit of the true term starts, in SI units"""


def true_term(name: str, recording: Recording) -> dict[str, Any]:
    """RMSE in degrees by axis, 1 s ahead on blocks left out: of the base and with the true term."""
    recording = with_known_controller(sampling_times(recording))
    setup = Setup((recording,), 0, FULL.correction)
    base = fit_base(setup)
    product = PRODUCTS[name]
    proposal = Proposal(f"empirical.{product}.{axis_of(name)}", (START,), product, True)
    wider = fit_with(setup, base, proposal)
    return {
        "before": held_out(base, ()).rmse_deg, "after": held_out(wider, ()).rmse_deg,
        "findings": [], "leftover": [], "verdict": "",
    }  # fmt: skip


def share_of_true_gain(name: str, diagnosed: Mapping[str, Any], true: Mapping[str, Any]) -> float:
    """The diagnosis' decrease of the RMSE on the torque's axis over that of the true term.

    ``diagnosed``: a diagnosis document; ``true``: from `true_term`. In [0, 1]; NaN if the true term
    gains nothing.
    """
    axis = str(axis_of(name))
    before, least = true["before"][axis], true["after"][axis]
    after = diagnosed["gain"]["holdout_rmse_deg"]["after"][axis]
    if not before > least:
        return float("nan")
    return min(max((before - (before if after is None else after)) / (before - least), 0.0), 1.0)


def proposes_true_formula(j: Judged) -> bool:
    """Whether the first residual torque has the hidden torque's axis and formula."""
    name = hidden(j)
    first = next(iter(j.line.get("document", {}).get("leftover", ())), None)
    product = PRODUCTS[name].replace("*", " * ")
    return bool(first and first["axis"] == axis_of(name) and first["formula"] == f"c * {product}")


def hidden(j: Judged) -> str:
    """The hidden effect outside the catalogue; the log may have others, such as vibration."""
    truth = j.line["truth"]
    return next(n for n in (*truth["names"], *truth["unseen"]) if n in PRODUCTS)


def figures(
    cases: Iterable[Judged], *, processes: int | None, folder: Path = FOLDER
) -> list[Figure]:
    """The rates of these flights; fits the true terms, which are kept like other results."""
    cases = [j for j in cases if "not_flown" not in j.line]
    right = sum(map(proposes_true_formula, cases))
    rate = Rate("outside the catalogue: true formula proposed", right, len(cases), 0.8)
    shares = []
    for name in OUTSIDE:
        some = [j for j in cases if name == hidden(j) and j.verdict is not None]
        jobs = [(j.group, int(j.line["seed"])) for j in some]
        fitted = run(jobs, f"true {name}", processes=processes, folder=folder) if jobs else {}
        shares += [
            share_of_true_gain(name, j.line["document"], fitted[j.line["case"]]["document"])
            for j in some if "document" in fitted[j.line["case"]]
        ]  # fmt: skip
    mean = float(np.nanmean(shares)) if shares else float("nan")
    return [
        rate.figure,
        Figure("outside the catalogue: gain of the extended model over that of the true term, mean",
               "–" if np.isnan(mean) else f"{100 * mean:.0f} %", "≥ 80 %",
               None if np.isnan(mean) else mean >= 0.8,
               f"{len(shares)} flights; decrease of the RMSE 1 s ahead on the torque's axis, on "
               "blocks left out"),
    ]  # fmt: skip


TOOLS |= {
    f"true {name}": Tool(f"true term: {name}", partial(true_term, name),
                         ("heli3dof", "tests/hidden/outside.py"))
    for name in OUTSIDE
}  # fmt: skip

"""Compute the data of a diagnosis report's figures, from the diagnosis and its recordings.

This module fits nothing. For each finding (reported cause) and each residual torque it runs the
Kalman filter over the fitted recordings. It replays two fitted models in closed loop: "before"
lacks the causes, "after" includes them. The replays follow the references of the held-out
recordings, or of the fitted ones if none was held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from heli3dof.diagnosis.result import Diagnosis, by_gain
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import Gain, HeldOut
from heli3dof.diagnosis.validation.simulation_error import SimulationError
from heli3dof.identification.greybox.method import model_of
from heli3dof.recording.recording import Recording
from heli3dof.report.figures.replayed_flight import Replayed, replayed
from heli3dof.report.figures.torque_curve import TorqueCurve, residual_evidence, torque_curve


@dataclass(frozen=True, eq=False)
class FigureData:
    """The data of the figures in a diagnosis report; a figure whose data are empty is omitted."""

    simulation_error: SimulationError | None = None
    """The simulation error by horizon and axis"""
    evidence: Sequence[TorqueCurve] = ()
    """Residual torque, averaged in bins, of each finding (reported cause) that acts as a torque"""
    residual_torques: Sequence[ResidualTorque] = ()
    residual_evidence: Sequence[TorqueCurve] = ()
    """Each of ``residual_torques``, averaged in bins, in the same order"""
    gain: Gain | None = None
    before: HeldOut | None = None
    """Predictions of held-out data without the causes"""
    after: HeldOut | None = None
    """Predictions of the same data with the causes"""
    replayed: Sequence[Replayed] = ()
    names: Sequence[str] = ()
    """Names of the recordings on which predictions without and with the causes were compared"""


def figure_data(
    found: Diagnosis, recordings: Sequence[Recording], holdout: Sequence[Recording] = ()
) -> FigureData:
    """Compute the data for the figures of a diagnosis; empty if faults prevented a fit."""
    f = found.fitted
    if f is None:
        return FigureData()
    if f.base is None or f.final is None:
        return FigureData(
            f.simulation_error,
            residual_torques=found.residual_torques,
            gain=f.gain if found.findings else None,
        )
    unseen = list(holdout) or list(recordings)
    flown: tuple[Replayed, ...] = ()
    if found.findings:
        base = model_of(f.base, list(recordings), "base")
        flown = replayed(base, f.model, unseen)
    findings = by_gain(found.findings)
    seen = (torque_curve(f.final, x.term, x.noise) for x in findings)
    return FigureData(
        f.simulation_error,
        [e for e in seen if e is not None],
        found.residual_torques,
        [residual_evidence(f.final, x) for x in found.residual_torques],
        f.gain if found.findings else None,
        f.before,
        f.after,
        flown,
        found.holdout or found.recordings,
    )

"""Evidence figures: the points of the residual torque lie on the fitted line."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from heli3dof.diagnosis.unmodelled.residual_torque import UNITS, LinearisedRun, linearised_run_at
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.cross_validation import on_blocks
from heli3dof.diagnosis.validation.gain import gain
from heli3dof.diagnosis.validation.simulation_error import simulation_error
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox, model_of
from heli3dof.model.effects import effects, term
from heli3dof.recording.recording import Recording
from heli3dof.report.figures import torque_curve as module
from heli3dof.report.figures.diagnosis import evidence_figure
from heli3dof.report.figures.diagnosis_data import FigureData
from heli3dof.report.figures.style import to_svg
from heli3dof.report.figures.torque_curve import (
    TorqueCurve,
    residual_evidence,
    torque_curve,
    variable_of,
)
from heli3dof.report.pages.diagnosis_section import diagnosis_section
from heli3dof.report.pages.html import page
from tests.flown import flown
from tests.report.text.test_diagnosis_tables import DOCUMENT

DAMPING = 0.1


@pytest.fixture(scope="module")
def recording() -> Recording:
    device = f"mock:?speed=max&hide=friction.viscous.yaw:{DAMPING}"
    return flown("rich", 40.0, device=device, seed=1221)


@pytest.fixture(scope="module")
def base(recording: Recording) -> Estimate:
    return fit_greybox(recording, ())


@pytest.fixture(scope="module")
def with_friction(recording: Recording) -> Estimate:
    return fit_greybox(recording, ("friction.viscous.yaw",))


@pytest.fixture(scope="module")
def seen(base: Estimate, with_friction: Estimate) -> TorqueCurve:
    result = torque_curve(with_friction, term("friction.viscous.yaw"), base.optimum.noise)
    assert result is not None
    return result


def test_viscous_friction_is_a_line_with_its_own_slope(seen: TorqueCurve) -> None:
    """−0.1 N·m per rad/s is −0.0017 N·m per °/s, in the points as in the curve."""
    assert (seen.axis, seen.depends_on, seen.unit) == ("yaw", "yaw_rate", "°/s")
    per_degree = -DAMPING * np.pi / 180
    points = np.polyfit(seen.z, seen.torque, 1, w=1 / seen.std)[0]
    assert points == pytest.approx(per_degree, rel=0.15)
    assert np.polyfit(seen.curve_z, seen.curve, 1)[0] == pytest.approx(per_degree, rel=0.1)


def test_a_pitch_offset_appears_as_a_yaw_torque_proportional_to_thrust() -> None:
    """Thrust tilted by the offset: τ = L_a K_f S sin(offset), 0.0041 N·m per volt at 3°."""
    device = "mock:?speed=max&hide=encoder.offset.pitch:3"
    flight = flown("rich", 40.0, device=device, seed=1222)
    without_offset, with_offset = (fit_greybox(flight, n) for n in ((), ("encoder.offset.pitch",)))
    e = torque_curve(with_offset, term("encoder.offset.pitch"), without_offset.optimum.noise)
    assert e is not None
    assert (e.axis, e.depends_on) == ("yaw", "voltage_sum")
    motor, arm = flight.profile.motor, flight.profile.geometry.L_a
    per_volt = arm * motor.K_f * np.sin(np.radians(3.0))
    assert np.polyfit(e.curve_z, e.curve, 1)[0] == pytest.approx(per_volt, rel=0.2)
    assert np.polyfit(e.z, e.torque, 1, w=1 / e.std)[0] == pytest.approx(per_volt, rel=0.2)


def test_most_points_lie_within_three_standard_errors_of_the_curve(seen: TorqueCurve) -> None:
    off = (seen.torque - np.interp(seen.z, seen.curve_z, seen.curve)) / seen.std
    assert np.mean(np.abs(off) < 3) > 0.8


def test_a_residual_torque_is_drawn_against_its_variable(base: Estimate) -> None:
    table = ((-0.5, 0.05), (0.5, -0.05))
    e = residual_evidence(
        base,
        ResidualTorque("yaw", "yaw_rate", 0.8, table, (0.01, 0.01), 200.0, 1.0, resembles=None),
    )
    assert e.curve_z == pytest.approx([-28.6479, 28.6479], rel=1e-4)
    assert np.corrcoef(e.z, e.torque)[0, 1] < -0.9


def test_an_effect_whose_torque_was_not_measured_has_no_figure(
    base: Estimate, with_friction: Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unmeasured(*known: Any) -> LinearisedRun:
        flight = linearised_run_at(*known)
        return replace(flight, noise=np.full_like(flight.noise, np.nan))

    monkeypatch.setattr(module, "linearised_run_at", unmeasured)
    friction = term("friction.viscous.yaw")
    assert torque_curve(with_friction, friction, base.optimum.noise) is None


def test_every_torque_effect_has_a_variable() -> None:
    for effect in effects().values():
        for axis in effect.axes or (None,):
            name = variable_of(effect, axis)
            if effect.name.startswith(("encoder.backlash", "timing.")):
                assert name is None
            elif effect.name.startswith(("encoder.", "motor.lag", "friction.viscous")):
                assert name in UNITS


def test_the_section_has_tables_and_figures_and_is_reproducible(
    recording: Recording, base: Estimate, with_friction: Estimate, seen: TorqueCurve
) -> None:
    before, after = on_blocks(base), on_blocks(with_friction)
    g = gain(before, after)
    model = model_of(with_friction, [recording], "extended")
    rest = ResidualTorque(
        "roll", "roll*pitch", 0.2, ((0.0, 0.0), (1.0, 0.1)), (0.1, 0.1), 30.0, 0.99
    )
    everything = FigureData(
        simulation_error=simulation_error(model, [recording]),
        evidence=(seen,),
        residual_torques=(rest,),
        gain=g,
        before=before,
        after=after,
        names=("<flight>",),
    )
    viscous = {**DOCUMENT["findings"][0], "effect": "friction.viscous"}
    section = diagnosis_section({**DOCUMENT, "findings": [viscous]}, everything)
    text = page("t", "s", [section])
    for expected in (
        "Verdict",
        "Simulation error",
        "roll × pitch",
        "reduction °",
        "Next experiment",
    ):
        assert expected in text
    assert text.count("<img") == 2
    assert "<svg" in to_svg(evidence_figure(seen))

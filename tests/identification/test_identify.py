"""`identify` on flights of an independent simulation, tests.identification.flights."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from heli3dof import stage_clock
from heli3dof.errors import RecordingError, UsageError
from heli3dof.identification import identify as module
from heli3dof.identification.feedback import Feedback
from heli3dof.identification.fit_result import FitResult, Request
from heli3dof.identification.greybox.method import DEFAULT_TERMS
from heli3dof.identification.identify import Identification, poor_prediction_warnings
from heli3dof.identification.identify import identify as identify_any
from heli3dof.identification.result import SUMMARY_HORIZON_S
from heli3dof.identification.validation import metrics
from heli3dof.recording.recording import Recording
from tests.identification.flights import flight, linear_truth
from tests.paths import needs_real_data
from tests.recording.make import changed

identify = partial(identify_any, method="pem")


@pytest.fixture(scope="module")
def flights() -> tuple[Recording, list[Recording]]:
    """The recording to fit, and three held-out ones."""
    one, *held_out = (
        flight("multisine", seed=s, seconds=60, rest=True) for s in (1, 101, 102, 103)
    )
    return one, held_out


@pytest.fixture(scope="module")
def found(flights: tuple[Recording, list[Recording]]) -> Identification:
    """A search over 40 ms and 80 ms chooses 40 ms."""
    return identify(flights[0], holdout=flights[1], intervals_s=[0.04])


def test_the_model_replays_held_out_flights_nearly_as_well_as_the_linearised_truth(
    found: Identification,
) -> None:
    """Three flights of 60 s, seeds 101–103: 88.4 % in pitch for the truth, 87.6 % for the model."""
    p = found.prepared
    truth = metrics(linear_truth(p.dt), p, p.held_out).replay.fit_percent
    np.testing.assert_array_less(truth - 2.0, found.metrics.replay.fit_percent)


def test_a_flight_that_a_safety_trip_ended_gives_a_warning(found: Identification) -> None:
    r = found.prepared.recordings[1]
    tripped = replace(r, meta={**r.meta, "outcome": "tripped"})
    (warning,) = set(
        module.recording_warnings(replace(found.prepared, recordings=(tripped,)))
    ) - set(module.recording_warnings(found.prepared))
    assert warning.startswith(f"{r.name}: the flight was ended for safety after ")


def test_the_rotor_lag_and_both_pendula_are_among_the_poles(found: Identification) -> None:
    """−10, −10; −0.027 ± 0.992j; −0.165 ± 0.723j, within four standard deviations."""
    for truth in (-0.027 + 0.992j, -0.165 + 0.723j):
        near = min(found.poles, key=lambda p: abs(p.value - truth))
        assert abs(near.value.real - truth.real) < 4 * near.std_real
        assert abs(near.value.imag - truth.imag) < 4 * near.std_imag
    lag = [p for p in found.poles if -16 < p.value.real < -6]
    assert len(lag) >= 2


@pytest.mark.parametrize(
    ("terms", "chosen"),
    [
        (None, None),
        ((), ()),
        (["motor.lag"], ("motor.lag",)),
        (["+friction.coulomb.yaw"], (*DEFAULT_TERMS, "friction.coulomb.yaw")),
        ("+friction.coulomb.yaw,-bias.torque.yaw", (*DEFAULT_TERMS[:-1], "friction.coulomb.yaw")),
    ],
)
def test_terms_are_read_as_on_the_command_line(
    flights: tuple[Recording, list[Recording]], monkeypatch: pytest.MonkeyPatch, terms: Any,
    chosen: Any,
) -> None:  # fmt: skip
    def fit(prepared: Any, request: Request) -> FitResult:
        assert request.terms == chosen
        raise StopIteration

    method = SimpleNamespace(physical=True, fit=fit, function="heli3dof:fit")
    monkeypatch.setattr(module, "known_method", lambda name: method)
    with pytest.raises(StopIteration):
        identify(flights[0], terms=terms)


def test_fit_falls_with_the_horizon(found: Identification) -> None:
    fits = {h: s.fit_percent[1] for h, s in found.metrics.prediction.items()}
    assert fits[0.0] > 98
    assert fits[0.0] > fits[0.1] > fits[0.5] > fits[1.0]
    assert fits[1.0] > 60


def test_feedback_is_detected_and_reported(found: Identification) -> None:
    assert isinstance(found.feedback, Feedback)
    assert found.feedback.present
    assert found.feedback.sentence in found.sentences()


def test_the_json_holds_the_keys_of_the_contract(found: Identification) -> None:
    document = json.loads(json.dumps(found.to_dict("m.json"), allow_nan=False))
    assert document["kind"] == "statespace"
    assert document["file"] == "m.json"
    assert len(document["poles"]) == found.order
    assert all(p["re_std_per_s"] > 0 for p in document["poles"])
    transfer = document["transfer_function"]
    assert len(transfer["entries"]) == 6
    assert len(transfer["denominator_std"]) == len(transfer["denominator"])
    assert {"whiteness", "past_inputs"} == set(document["residual_tests"])
    assert document["fit_percent"]["pitch"]["closed_loop_replay"] > 80


def test_a_notebook_shows_three_lines_a_table_and_a_figure(found: Identification) -> None:
    lines = repr(found).splitlines()
    assert len(lines) == 3
    assert lines[0].startswith(f"model 'pem' by pem: order {found.order}, fitted every ")
    assert len(repr(found)) < 400
    assert "pole" in found.summary()
    assert "closed-loop replay: roll" in found._repr_html_()
    table = found.to_dataframe()
    assert list(table["re_per_s"]) == [p.value.real for p in found.poles]
    assert found.plot().axes


def test_the_transfer_functions_are_those_of_the_model(found: Identification) -> None:
    import control

    s = 1.3j
    tf = found.transfer
    by_hand = np.array(
        [[np.polyval(tf.num[i, j], s) / np.polyval(tf.den, s) for j in range(2)] for i in range(3)]
    )
    model = found.model.to_transfer_function()  # type: ignore[attr-defined]
    assert isinstance(model, control.TransferFunction)
    np.testing.assert_allclose(model(s), by_hand, rtol=1e-3)
    G, std = found.frequency_response(np.array([1.3]))
    np.testing.assert_allclose(G[0], by_hand, rtol=1e-6)
    assert (std > 0).all()
    assert (std[0, :2] < np.abs(G[0, :2]).max()).all()


def test_the_model_names_its_recordings(
    found: Identification, flights: tuple[Recording, list[Recording]]
) -> None:
    extra = found.model.extra  # type: ignore[attr-defined]
    assert extra["recordings"] == [{"name": "multisine-1", "sha256": flights[0].digest}]


def test_a_single_recording_is_split_and_the_report_states_it(
    flights: tuple[Recording, list[Recording]],
) -> None:
    result = identify(flights[0], order=8, intervals_s=[0.08])
    assert "last 25 %" in result.prepared.split
    assert result.metrics.replay.fit_percent[1] > 80


def test_output_error_gets_a_warning_and_is_worse(
    flights: tuple[Recording, list[Recording]], found: Identification
) -> None:
    oe = identify(flights[0], holdout=flights[1], method="oe", order=8, intervals_s=[0.04])
    assert any("Output error assumes" in w for w in oe.warnings)
    assert oe.model.kind == "oe"
    assert oe.metrics.prediction[1.0].fit_percent[1] < found.metrics.prediction[1.0].fit_percent[1]


def test_the_paper_s_form_has_four_poles(flights: tuple[Recording, list[Recording]]) -> None:
    tf4 = identify(flights[0], holdout=flights[1][0], method="tf4")
    assert tf4.model.kind == "tf4"
    assert len(tf4.poles) == 4
    assert tf4.transfer.lines()[0].startswith("T(s)_{1,1} = (")
    assert "s^4" in tf4.transfer.lines()[0]


def test_pbsid_warns_that_it_has_no_standard_deviations(
    flights: tuple[Recording, list[Recording]],
) -> None:
    result = identify(flights[0], holdout=flights[1][0], method="pbsid", order=8)
    document = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert document["poles"][0]["re_std_per_s"] is None
    assert any("no standard deviations" in w for w in result.warnings)


def test_the_same_recordings_give_the_same_model(
    flights: tuple[Recording, list[Recording]],
) -> None:
    part = flights[0].between(0, 30)
    a, b = (identify(part, order=6, intervals_s=[0.08]) for _ in range(2))
    np.testing.assert_array_equal(a.model.A, b.model.A)  # type: ignore[attr-defined]


def test_several_recordings_are_fitted_together() -> None:
    short = [flight("multisine", seed=s, seconds=25) for s in (1, 2, 3)]
    result = identify(short, holdout=flight("multisine", seed=9, seconds=30), order=8)
    assert result.metrics.replay.fit_percent[1] > 80


def test_an_unknown_method_names_the_nearest() -> None:
    with pytest.raises(UsageError, match="did you mean 'pem'"):
        identify(flight(seconds=6), method="pen")


@pytest.mark.parametrize("order", [0, 21])
def test_an_impossible_order_is_rejected(order: int) -> None:
    with pytest.raises(UsageError, match=f"^order {order} "):
        identify(flight(seconds=6), order=order)


def test_a_one_angle_recording_is_rejected() -> None:
    rec = changed(flight(seconds=10), "angle", (slice(None), slice(1, None)), np.nan)
    with pytest.raises(RecordingError, match="roll, but not pitch, yaw"):
        identify(rec)


@pytest.mark.parametrize("method", ["greybox", "freeflight"])
def test_a_clamped_axis_keeps_the_profile_s_values(
    method: str, flights: tuple[Recording, list[Recording]]
) -> None:
    moving = flights[0].between(0.0, 30.0)
    clamped = replace(moving, angle=moving.angle * [0.0, 1.0, 0.0])
    found = identify_any(clamped, method=method)
    p = clamped.profile
    body = {"T_g": p.trim_torque, "J_roll": p.inertias[0], "J_yaw": p.inertias[2]}
    for name, value in body.items():
        assert found.model.parameters[name] == pytest.approx(value)
        assert name not in found.found.parameters
    assert "J_pitch" in found.found.parameters
    assert not any("roll" in name or "yaw" in name for name in found.found.parameters)
    assert {f.output for f in found.factored} == {"pitch"}
    outputs = found.to_dict()["transfer_function"]["entries"]
    assert {e["output"] for e in outputs} == {"pitch_deg"}
    about = [w for w in found.warnings if "roll" in w or "yaw" in w or "bound" in w]
    assert about == [
        "roll and yaw never change in these recordings: J_roll, J_yaw, T_g are fixed at the "
        "profile's values."
    ]
    assert np.isfinite(found.metrics.prediction[0.5].fit_percent).tolist() == [False, True, False]
    assert found.model.extra["recordings"][0]["sha256"] == clamped.digest
    with pytest.raises(RecordingError, match="roll and yaw never change"):
        identify(clamped)


def test_held_out_motion_far_beyond_the_training_data_gets_a_warning() -> None:
    small = flight("steps", seed=1, seconds=40, noise=0.3)
    result = identify(small, holdout=flight("large", seed=2, seconds=40), order=6)
    assert any("extrapolation" in w for w in result.warnings)


def test_a_noisier_flight_has_wider_deviations() -> None:
    quiet, loud = (
        identify(flight("multisine", seed=4, seconds=50, noise=x), order=8, intervals_s=[0.08])
        for x in (0.3, 2.0)
    )

    def spread(f: Identification) -> float:
        near = min(f.poles, key=lambda p: abs(p.value - (-0.165 + 0.723j)))
        return near.std_real

    assert spread(loud) > 2 * spread(quiet)


@needs_real_data
@pytest.mark.real_data
def test_rig_b_predicts_held_out_data_half_a_second_ahead() -> None:
    from heli3dof.recording.load import load
    from heli3dof.rig.profile import load_profile
    from tests.paths import REAL_DATA

    profile = load_profile(REAL_DATA / "rig-b" / "profile.toml")
    recs = [
        load(REAL_DATA / "rig-b" / f"closed-{k}.csv", profile) for k in ("03", "05", "08", "13")
    ]
    result = identify(recs[:3], holdout=recs[3], intervals_s=[0.04], order=8)
    assert result.metrics.prediction[0.5].fit_percent.min() > 75
    assert "no [controller]" in result.metrics.replay_note


def test_a_search_for_the_order_reports_how_many_models_it_has_fitted(
    flights: tuple[Recording, list[Recording]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stage_clock, "PROGRESS_EVERY_S", 0.0)
    said: list[str] = []
    identify_any(flights[0], method="pbsid", progress=said.append)
    assert "Fitting the model … candidate models: 0 of 10" in said
    assert any(s.startswith("Fitting the model … candidate models: 9 of 10") for s in said)


def test_the_warning_and_the_summary_speak_of_the_same_horizon(found: Identification) -> None:
    fit = np.array([-1.0, 50.0, 50.0])
    bad = replace(found.metrics.prediction[SUMMARY_HORIZON_S], fit_percent=fit)
    scores = replace(found.metrics, prediction={SUMMARY_HORIZON_S: bad})
    (warning,) = poor_prediction_warnings(scores, found.prepared)
    assert warning.startswith("1 s predictions of roll are worse than the mean")
    assert "fit 1 s ahead" in found.summary()


def test_held_out_data_that_hardly_move_do_not_test_a_model(found: Identification) -> None:
    fit = np.array([-1.0, 50.0, 50.0])
    bad = replace(found.metrics.prediction[SUMMARY_HORIZON_S], fit_percent=fit)
    scores = replace(found.metrics, prediction={SUMMARY_HORIZON_S: bad})
    recordings = tuple(replace(r, angle=0.01 * r.angle) for r in found.prepared.recordings)
    still = replace(found.prepared, recordings=recordings)
    (warning,) = poor_prediction_warnings(scores, still)
    assert warning.startswith("The held-out data hardly move (roll 0.0")
    assert warning.endswith("heli3dof run multisine")
    lab = found.prepared.recordings[0].profile.model_copy(update={"name": "lab"})
    of_lab = tuple(replace(r, profile=lab) for r in recordings)
    (warning,) = poor_prediction_warnings(scores, replace(still, recordings=of_lab))
    assert warning.endswith("heli3dof run multisine --profile PROFILE.toml")

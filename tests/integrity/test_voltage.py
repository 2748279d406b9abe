"""Recorded voltages that are not the voltages at the motors."""

from __future__ import annotations

import itertools
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from heli3dof.axes import MOTORS
from heli3dof.integrity import Kind, integrity
from heli3dof.integrity.remedies import column_of, voltage_remedy
from heli3dof.integrity.view import View
from heli3dof.integrity.voltage import OPPOSED
from heli3dof.recording.logs.column_mapping import parse_mapping
from heli3dof.recording.logs.corrections import corrected
from heli3dof.recording.logs.export import export
from heli3dof.recording.logs.import_log import import_log
from heli3dof.recording.recording import Recording
from tests.integrity.flights import flight, names, only, turned, with_voltage
from tests.paths import needs_real_data
from tests.recording.logs.test_raw_logs import (
    RIG_B,
    RIG_C,
    converted,
    file_of_rig_b,
    files_of_rig_c,
    rig,
)

PLANS = ("rich", "steps", "run-step")


@pytest.mark.parametrize("plan", PLANS)
def test_an_amplifier_gain_of_three_is_detected(plan: str) -> None:
    fault = only(with_voltage(flight(plan), 1 / 3))
    assert (fault.check, fault.kind) == ("amplifier.gain", Kind.BAD_DATA)
    assert fault.parameters["gain"][0] == pytest.approx(3.0, rel=0.1)
    assert "switch" in fault.cause


def test_a_thrust_gain_off_by_a_third_is_not_a_fault() -> None:
    assert names(flight("rich", "motor.thrust_gain:1.35"), *Kind.ORDER[:3]) == set()


@pytest.mark.parametrize(
    ("factor", "word"), [(1000, "millivolts"), (100 / 24, "per cent"), (1 / 24, "fractions")]
)
def test_another_unit_is_named(factor: float, word: str) -> None:
    fault = only(with_voltage(flight(), factor))
    assert fault.kind == Kind.BAD_DATA
    assert word in fault.cause


@pytest.mark.parametrize("factor", [100 / 24, 1 / 24])
def test_a_log_in_another_unit_is_corrected_by_the_expressions_of_its_columns(
    factor: float,
) -> None:
    r = flight()
    fault = only(
        replace(
            r, voltage=factor * r.voltage, voltage_cmd=np.full_like(r.voltage, np.nan),
            meta={"name": "log", "source": "import", "log_mapping": {"v_back_V": "u[1]+0"}},
        )
    )  # fmt: skip
    k = f"{1 / factor:g}"
    assert fault.fix == (
        f"import the log with --map 'v_front_V={k}*v_front_V' --map 'v_back_V={k}*(u[1]+0)'"
    )


def options_of(fix: str) -> dict[str, str]:
    """Return the mapping that the ``--map`` options of a remedy state."""
    words = shlex.split(fix)
    return parse_mapping([after for word, after in itertools.pairwise(words) if word == "--map"])


@pytest.mark.parametrize(
    ("form", "inverse"),
    [("100/24*{}", "0.24*{}"), ("{}/24", "24*{}"), ("{}/3", "3*{}"), ("{}-7.4", "{}+7.4")],
)
def test_commands_in_the_same_unit_are_corrected_too(
    form: str, inverse: str, tmp_path: Path
) -> None:
    r, log = flight("steps"), tmp_path / "log.csv"
    export(r, log)
    logged = [f"v_{m}{kind}_V" for m in MOTORS for kind in ("", "_cmd")]
    wrong = import_log(log, r.profile, mapping={n: form.format(n) for n in logged})
    options = options_of(only(wrong).fix)
    assert set(options) == set(logged)
    right = import_log(log, r.profile, mapping=options)
    assert np.allclose(right.voltage, r.voltage, atol=0.1)
    assert np.allclose(right.voltage_cmd, r.voltage_cmd, atol=0.1)
    half = import_log(log, r.profile, mapping={n: form.format(n) for n in logged[::2]})
    remedy = voltage_remedy(half, inverse.format("{f}"), inverse.format("{b}"))
    assert set(options_of(remedy)) == {"v_front_V", "v_back_V"}


def test_a_remedy_contains_only_columns_of_the_log() -> None:
    mapping = {"v_front_cmd_V": "5*u", "v_front_V": "clip(v_front_cmd_V, -9, 9)", "v_back_V": "w"}
    r = replace(flight(), meta={"name": "log", "source": "import", "log_mapping": mapping})
    assert column_of(r, "v_front_V") == ("v_front_V", "clip((5*u), -9, 9)")
    assert column_of(r, "v_back_V") == ("v_back_V", "w")


def test_the_limit_is_named_only_if_the_amplified_voltages_exceed_it() -> None:
    r = with_voltage(flight(), 1 / 3)
    assert "v_max" not in only(r).fix
    motor = r.profile.motor.model_copy(update={"v_max": r.profile.motor.v_max / 3})
    lower = replace(r, profile=r.profile.model_copy(update={"motor": motor}))
    assert only(lower).fix.endswith("multiply motor.v_max by 3")


def about_hover(r: Recording) -> Recording:
    """Return the flight as a log with voltages less the profile's hover voltage."""
    return replace(
        r, voltage=r.voltage - r.profile.motor.V_o,
        voltage_cmd=np.full_like(r.voltage, np.nan), meta={"name": "log", "source": "import"},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("plan", "hide"),
    [*((p, "") for p in PLANS), ("rich", "motor.thrust_gain:0.85"), ("steps", "motor.lag:0.15")],
)
def test_a_subtracted_hover_voltage_is_named_with_the_way_back(plan: str, hide: str) -> None:
    fault = only(about_hover(flight(plan, hide)))
    assert (fault.check, fault.kind) == ("voltage.unit", Kind.BAD_DATA)
    assert "hover voltage was subtracted" in fault.cause
    assert "--map v_back_V=v_back_V+7.4" in fault.fix


def test_an_arm_that_is_nearly_in_balance_hovers_at_a_small_voltage() -> None:
    r = flight("rich", "mass.imbalance:-0.9")
    assert View(r).hover_ratio == pytest.approx(0.2, abs=0.07)
    assert names(r, *Kind.ORDER[:3]) == set()


@needs_real_data
@pytest.mark.real_data
def test_a_real_log_about_hover_is_bad_data_until_the_mean_is_added() -> None:
    mapping = {name: text.replace(" + 5.48", "") for name, text in RIG_C.items()}
    fault = only(import_log(files_of_rig_c(), rig(), mapping=mapping))
    assert fault.check == "voltage.unit"
    assert "subtracted" in fault.cause
    assert "/2)+3.7" in fault.fix or "-5, 5))+3.7" in fault.fix


def sum_and_difference(r: Recording, of_sum: int, sign: float) -> Recording:
    """Return the flight as a log with the sum in voltage column ``of_sum`` and ± the difference."""
    V = np.column_stack([r.voltage.sum(axis=1), sign * (r.voltage[:, 0] - r.voltage[:, 1])])
    return replace(
        r, voltage=V if of_sum == 0 else V[:, ::-1], voltage_cmd=np.full_like(V, np.nan),
        meta={"name": "log", "source": "import"}, channels={},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("plan", "of_sum", "sign"),
    [
        ("rich", 0, 1),
        ("steps", 1, -1),
        *(("run-step", i, sign) for i in (0, 1) for sign in (1, -1)),
    ],
)
def test_sum_and_difference_are_named_with_the_way_back(
    plan: str, of_sum: int, sign: int, tmp_path: Path
) -> None:
    r = sum_and_difference(flight(plan), of_sum, sign)
    fault = only(r)
    assert (fault.check, fault.kind) == ("columns.sum_and_difference", Kind.BAD_DATA)
    log = tmp_path / "log.csv"
    export(r, log)
    again = import_log(log, r.profile, mapping=options_of(fault.fix))
    assert np.allclose(again.voltage, flight(plan).voltage, atol=1e-6)
    assert names(again, Kind.BAD_DATA) == set()


@pytest.mark.parametrize(
    "hide", ["bias.torque.pitch:0.17", "motor.thrust_mismatch:2,bias.torque.pitch:0.1"]
)
def test_motors_that_carry_unequal_weights_are_not_sum_and_difference(hide: str) -> None:
    r = flight("rich", hide)
    front, back = r.voltage[View(r).airborne].mean(axis=0)
    assert min(front, back) < OPPOSED * max(front, back)
    assert "columns.sum_and_difference" not in names(r)


@needs_real_data
@pytest.mark.real_data
def test_sum_and_difference_of_real_logs_are_named() -> None:
    for r in converted():
        for of_sum, sign in ((0, 1), (1, -1)):
            assert names(sum_and_difference(r, of_sum, sign), Kind.BAD_DATA) == {
                "columns.sum_and_difference"
            }, r.name


def with_limit(r: Recording, v_max: float) -> Recording:
    motor = r.profile.motor.model_copy(update={"v_max": v_max})
    return replace(r, profile=r.profile.model_copy(update={"motor": motor}))


def test_voltages_before_the_limiter_are_only_a_note() -> None:
    r = with_limit(flight("large", "motor.saturation:9"), 9.0)
    faults = [f for f in integrity(r) if f.check == "voltage.limit"]
    assert [f.kind for f in faults] == [Kind.NOTE]
    assert np.abs(corrected(r).voltage).max() == 9.0


def test_voltages_that_a_stronger_amplifier_applied_are_bad_data() -> None:
    r = flight("large")
    limit = float(np.quantile(np.abs(r.voltage).max(axis=1), 0.97))
    fault = only(with_limit(r, limit))
    assert (fault.check, fault.kind) == ("voltage.limit", Kind.BAD_DATA)
    assert "motor.v_max" in fault.fix


def raw(rig_name: str, pitch_sign: int) -> Recording:
    """Return a raw log of a real rig, with the voltages before the card's limit of ±5 V."""
    mapping, files = {"rig-b": (RIG_B, [file_of_rig_b()]), "rig-c": (RIG_C, files_of_rig_c())}[
        rig_name
    ]
    asked = {f"v_{m}_V": mapping[f"v_{m}_cmd_V"] for m in MOTORS}
    angles = {name: text for name, text in mapping.items() if name.endswith("_rad")}
    r = import_log(files, rig(), mapping=asked | angles)
    return r if pitch_sign > 0 else turned(1)(r)


@needs_real_data
@pytest.mark.real_data
@pytest.mark.parametrize("rig_name", ["rig-b", "rig-c"])
def test_real_logs_of_voltages_before_the_limiter_are_usable(rig_name: str) -> None:
    r = raw(rig_name, 1)
    assert "voltage.limit" in names(r, Kind.NOTE)
    assert names(r, Kind.BAD_DATA) == set()
    assert "encoder.sign.pitch" in names(raw(rig_name, -1), Kind.BAD_DATA)


@needs_real_data
@pytest.mark.real_data
def test_real_commands_are_not_taken_for_voltages_at_the_motors() -> None:
    for r in converted():
        asked = replace(r, voltage=r.voltage_cmd, voltage_cmd=np.full_like(r.voltage, np.nan))
        assert names(asked, Kind.BAD_DATA) == set(), r.name


def test_a_gain_between_the_two_voltages_is_detected() -> None:
    r = flight()
    assert only(replace(r, voltage=r.voltage / 3)).check == "voltage.commanded"


def test_a_command_one_row_late_is_only_a_note() -> None:
    r = flight()
    late = np.vstack([r.voltage[:1], r.voltage[:-1]])
    faults = names(replace(r, voltage=late))
    assert faults == names(replace(r, voltage=late), Kind.NOTE)
    assert faults == {"voltage.commanded", "controller.voltage"}


def test_a_limiter_below_the_profile_s_is_a_note() -> None:
    r = flight("large")
    clipped = np.clip(r.voltage, -9.0, 9.0)
    assert "voltage.clipped" in names(replace(r, voltage=clipped, voltage_cmd=clipped), Kind.NOTE)


def test_missing_voltages_are_bad_data() -> None:
    r = flight()
    assert only(replace(r, voltage=np.full_like(r.voltage, np.nan))).kind == Kind.BAD_DATA


@pytest.mark.parametrize("motor", [0, 1])
def test_a_wrong_sign_of_one_motor_is_not_another_unit(motor: int) -> None:
    r = flight()
    sign = np.where(np.arange(2) == motor, -1.0, 1.0)
    fault = only(replace(r, voltage=r.voltage * sign, voltage_cmd=r.voltage_cmd * sign))
    assert (fault.check, fault.kind) == ("voltage.sign", Kind.BAD_DATA)
    voltage, command = f"v_{MOTORS[motor]}_V", f"v_{MOTORS[motor]}_cmd_V"
    assert fault.fix == f"compute {voltage} as -{voltage} and {command} as -{command}"

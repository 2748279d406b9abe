from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.model.control.voltage_replay import (
    Match,
    VoltageReplay,
    is_late,
    voltage_replay,
    with_known_controller,
)
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.recording import Recording
from tests.paths import ROOT


@pytest.fixture(scope="module")
def excited() -> Recording:
    """A flight with an excitation; it begins on the table."""
    return read_recording(ROOT / "recordings" / "train-1.mcap")


def compared(recording: Recording) -> VoltageReplay:
    result = voltage_replay(recording)
    assert result is not None
    return result


def with_controller(recording: Recording, **values: object) -> Recording:
    spec = recording.profile.controller
    assert spec is not None
    changed = spec.model_copy(update=values)
    return replace(recording, profile=recording.profile.model_copy(update={"controller": changed}))


def late(recording: Recording) -> Recording:
    return replace(recording, voltage=np.vstack([recording.voltage[:1], recording.voltage[:-1]]))


def without_extra(recording: Recording) -> Recording:
    return replace(recording, voltage_extra=np.full_like(recording.voltage, np.nan))


def test_the_controller_that_flew_reproduces_the_voltages(excited: Recording) -> None:
    result = compared(excited)
    assert result.match is Match.REPRODUCED
    assert result.share < 1e-9
    assert with_known_controller(excited) is excited


def test_half_a_count_between_controller_and_log_is_a_constant_and_a_ramp(
    excited: Recording,
) -> None:
    half = 0.5 * excited.profile.encoder.rad_per_count
    result = compared(replace(excited, angle=excited.angle - half))
    assert result.match is Match.REPRODUCED
    assert result.share < 0.05


def test_another_gain_is_another_controller(excited: Recording) -> None:
    K = 1.3 * np.array(excited.profile.controller.K)  # type: ignore[union-attr]
    other = with_controller(excited, K=tuple(map(tuple, K.tolist())))
    assert compared(other).match is Match.OTHER
    assert compared(without_extra(other)).match is not Match.REPRODUCED
    assert not with_known_controller(other).profile.controller_is_known


def test_another_filter_is_another_controller(excited: Recording) -> None:
    other = with_controller(excited, derivative_cutoff_hz=8.0)
    assert compared(other).match is Match.OTHER


def test_a_voltage_of_the_previous_sample_is_late(excited: Recording) -> None:
    assert compared(late(excited)).match is Match.LATE
    assert is_late(with_known_controller(late(excited)))
    assert not is_late(excited)


def test_an_excitation_that_was_not_logged_becomes_the_extra_voltage(excited: Recording) -> None:
    bare = without_extra(excited)
    result = compared(bare)
    assert result.match is Match.EXCITED
    used = result.difference.any(axis=1)
    assert used.mean() > 0.5
    missed = result.difference[used] - excited.voltage_extra[used]  # its own constant and line
    assert missed.std() < 0.05 * excited.voltage_extra[used].std()
    assert compared(with_known_controller(bare)).share < 0.01


def test_lost_samples_do_not_count(excited: Recording) -> None:
    kept = np.ones(len(excited), dtype=bool)
    kept[5000:5040] = kept[12000] = False
    result = compared(excited.rows(np.flatnonzero(kept)))
    assert result.match is Match.REPRODUCED


@pytest.mark.parametrize(
    "what", ["no controller", "no reference", "two axes", "decimated", "short"]
)
def test_without_the_whole_loop_there_is_no_comparison(excited: Recording, what: str) -> None:
    missing = np.full_like(excited.angle, np.nan)
    given = {
        "no controller": lambda r: replace(
            r, profile=r.profile.model_copy(update={"controller": None})
        ),
        "no reference": lambda r: replace(r, reference=missing),
        "two axes": lambda r: replace(r, angle=np.column_stack([r.angle[:, :2], missing[:, 2]])),
        "decimated": lambda r: r.rows(slice(0, None, 5)),
        "short": lambda r: r.rows(slice(0, 1500)),
    }[what](excited)
    assert voltage_replay(given) is None
    known = with_known_controller(given)
    if what == "no controller":
        assert known.identified_controller is not None
    else:
        assert known is given

"""A link that delays, loses or repeats is warned of; a good one is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from heli3dof.identification.identify import identify
from heli3dof.recording.link_quality import LOSS_SHARE, link_warnings
from tests.flown import flown

DT = 2e-3
GOOD: dict[str, Any] = {
    "lost": 0,
    "device_skipped": 0,
    "link": {"rejected": 0},
    "latency": {
        "commands": 1000, "commands_unacknowledged": 10, "commands_never_echoed": 10,
        "median_s": 1.99e-3,
    },
}  # fmt: skip


def changed(**changes: Any) -> dict[str, Any]:
    latency = {**GOOD["latency"], **{k: v for k, v in changes.items() if k in GOOD["latency"]}}
    return {**GOOD, **{k: v for k, v in changes.items() if k in GOOD}, "latency": latency}


def test_a_good_link_gives_no_warning() -> None:
    assert link_warnings(GOOD, 1000, DT) == []
    assert link_warnings({}, 0, DT) == []
    assert link_warnings({"latency": None, "link": None}, 0, DT) == []


def test_latency_above_one_period_gives_a_warning_with_its_size() -> None:
    (message,) = link_warnings(changed(median_s=5.7e-3, commands_unacknowledged=1000), 1000, DT)
    assert "latency is 5.7 ms (median), more than the control period of 2 ms" in message
    assert "FTDI latency timer" in message
    assert "heli3dof doctor" in message


def test_more_than_one_percent_of_unacknowledged_commands_gives_a_warning() -> None:
    (message,) = link_warnings(changed(commands_unacknowledged=11), 1000, DT)
    assert message.startswith(
        "11 of 1000 commands (1.1%) were not echoed by the next sample; 10 were"
    )
    assert "loses frames" in message


def test_commands_that_are_never_echoed_in_time_are_not_blamed_on_lost_frames() -> None:
    (message,) = link_warnings(changed(median_s=None, commands_unacknowledged=1000), 1000, DT)
    assert "a latency above the control period, or a device that ignores commands" in message
    assert "loses frames" not in message


def test_an_overloaded_device_is_named_as_the_cause() -> None:
    (message,) = link_warnings(changed(commands_unacknowledged=60, device_skipped=50), 1000, DT)
    assert "the device is overloaded (it skipped 50 samples)" in message


@pytest.mark.parametrize(("lost", "warned"), [(10, 0), (11, 1)])
def test_more_than_one_percent_of_lost_samples_gives_a_warning(lost: int, warned: int) -> None:
    assert len(link_warnings(changed(lost=lost), 1000, DT)) == warned


def test_the_share_of_lost_samples_counts_the_ramp_to_zero() -> None:
    (message,) = link_warnings(changed(lost=730), 2190, DT)
    assert message.startswith("730 of 2920 samples (25.0%) were lost on the line")


def test_a_rejected_sample_gives_a_warning() -> None:
    (message,) = link_warnings(changed(link={"rejected": 1}), 1000, DT)
    assert "1 samples were rejected: repeated" in message


@pytest.mark.accuracy
def test_a_loss_without_a_warning_hardly_moves_the_estimates() -> None:
    whole = flown("rich", device="mock:?speed=max&seed=1")
    drawn = np.random.default_rng(1).permutation(len(whole))
    thinned = whole.rows(np.sort(drawn[: round((1 - LOSS_SHARE) * len(whole))]))
    a, b = (identify(r).found.parameters for r in (whole, thinned))
    moved = {name: abs(b[name].value - p.value) / p.std for name, p in a.items()}
    assert max(moved.values()) < 0.1, moved

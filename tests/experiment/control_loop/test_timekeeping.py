"""Each of the three clocks reports a sample as on time, late, missed or lost."""

from __future__ import annotations

import random
from dataclasses import replace
from types import SimpleNamespace

import pytest

from heli3dof.experiment.control_loop.timekeeping import (
    DeviceDeadlines,
    HostDeadlines,
    VirtualDeadlines,
    timekeeper,
)
from heli3dof.rig.interface import Flags, Identity, Sample

DT = 0.002
IDENTITY = Identity("t", "t", "1", "1", "1", (1, 1, 1), 24.0, 0.1, "host", True)
NOTHING = 0.0, 0, 0


def sample(device_s: float, host_s: float) -> Sample:
    return Sample(0, device_s, (0, 0, 0), (0.0, 0.0), (0.0, 0.0), Flags(0), host_s)


def judged(time: VirtualDeadlines) -> tuple[float, int, int]:
    return pytest.approx(time.lateness, abs=2e-6), time.missed, time.lost


def started(kind: type, host_s: float = 100.0) -> VirtualDeadlines:
    time = kind(DT)
    time.start(sample(7.0, host_s))
    return time


@pytest.mark.parametrize(
    ("timebase", "kind"),
    [("host", HostDeadlines), ("device", DeviceDeadlines), ("virtual", VirtualDeadlines)],
)
def test_the_rigs_timebase_chooses_the_clock(timebase: str, kind: type) -> None:
    rig = SimpleNamespace(identity=replace(IDENTITY, timebase=timebase))
    assert type(timekeeper(rig, DT)) is kind


def test_on_a_virtual_clock_nothing_is_late() -> None:
    time = started(VirtualDeadlines)
    time.next()
    time.arrived(sample(7 + DT, 500.0), 100.0)
    assert judged(time) == NOTHING


def test_the_hosts_deadlines_are_absolute() -> None:
    time = started(HostDeadlines)
    for k, late in enumerate([0.0, 0.0015, 0.0, 0.001], 1):
        due = time.next()
        assert due == pytest.approx(100 + k * DT)
        time.arrived(sample(7 + k * DT, due + late), due - DT)
        assert judged(time) == (late, 0, 0)


def test_missed_periods_are_skipped_and_deadlines_stay_on_the_grid() -> None:
    time = started(HostDeadlines)
    due = time.next()
    time.arrived(sample(7.013, due + 5.5 * DT), due - DT)
    assert judged(time) == (5.5 * DT, 5, 0)
    assert time.next() == pytest.approx(100 + 7 * DT)


def stream(time: VirtualDeadlines, first: int, last: int, way_s: float = 0.0) -> None:
    """Punctual samples of a device-timed stream."""
    for k in range(first, last + 1):
        time.next()
        time.arrived(sample(7 + k * DT, 100 + k * DT + way_s), 100 + (k - 1) * DT + 1e-4)


def test_lateness_of_a_stream_is_measured_by_the_devices_clock() -> None:
    time = started(DeviceDeadlines)
    stream(time, 1, 100)
    assert judged(time) == NOTHING
    time.arrived(sample(7 + 101 * DT, 100 + 101 * DT + 0.0013), 100 + 100 * DT + 1e-4)
    assert judged(time) == (0.0013, 0, 0)
    stream(time, 102, 110)
    assert judged(time) == NOTHING


def test_samples_that_did_not_come_while_the_host_waited_are_lost() -> None:
    time = started(DeviceDeadlines)
    stream(time, 1, 10)
    time.arrived(sample(7 + 13 * DT, 100 + 13 * DT), 100 + 10 * DT + 1e-4)
    assert judged(time) == (0.0, 0, 2)


def test_samples_that_came_while_the_host_was_away_are_missed() -> None:
    time = started(DeviceDeadlines)
    stream(time, 1, 10)
    # The host asks 3.3 periods late and gets the newest sample.
    requested = 100 + 13.3 * DT
    time.arrived(sample(7 + 13 * DT, requested + 1e-5), requested)
    late, missed, lost = judged(time)
    assert (missed, lost) == (2, 0)
    assert late == pytest.approx(2.3 * DT + 1e-5, abs=2e-6), (
        "from the first deadline that was not met"
    )
    stream(time, 14, 20)
    assert judged(time) == NOTHING


def after_ten_samples(link: SimpleNamespace) -> VirtualDeadlines:
    """The clock of a rig that streams by its own clock, with these counters of the link."""
    rig = SimpleNamespace(identity=replace(IDENTITY, timebase="device"), statistics=link)
    time = timekeeper(rig, DT)
    time.start(sample(7.0, 100.0))
    stream(time, 1, 10)
    return time


def test_the_links_count_of_lost_samples_is_used() -> None:
    # While the host was away two samples came and were passed over, and one was lost.
    link = SimpleNamespace(lost=7)
    time = after_ten_samples(link)
    link.lost = 8
    time.arrived(sample(7 + 14 * DT, 100 + 14 * DT + 0.0004), 100 + 10 * DT + 1e-4)
    assert judged(time) == (2 * DT + 0.0004, 2, 1)
    time.arrived(sample(7 + 16 * DT, 100 + 16 * DT), 100 + 14 * DT + 1e-3)
    assert judged(time) == (DT, 1, 0)


def test_what_the_device_left_out_is_neither_lost_nor_missed() -> None:
    # One sample was lost, three the device never made, and one came while the host was away.
    link = SimpleNamespace(lost=7, device_skipped=2, samples_stale=1)
    time = after_ten_samples(link)
    link.lost, link.device_skipped, link.samples_stale = 8, 5, 2
    time.arrived(sample(7 + 16 * DT, 100 + 16 * DT + 0.0004), 100 + 10 * DT + 1e-4)
    assert (*judged(time), time.device_skipped) == (DT + 0.0004, 1, 1, 3)
    stream(time, 17, 18)
    assert (*judged(time), time.device_skipped) == (*NOTHING, 0)


def test_samples_lost_while_the_host_read_nothing_are_missed() -> None:
    link = SimpleNamespace(lost=0, device_skipped=0, samples_stale=0)
    time = after_ten_samples(link)
    link.lost, link.samples_stale = 84, 400
    time.arrived(sample(7 + 495 * DT, 100 + 495 * DT), 100 + 10 * DT + 1e-4)
    assert (time.missed, time.lost) == (484, 0)


def test_host_time_and_device_time_report_the_same_delay() -> None:
    away = 4.4 * DT
    host, device = started(HostDeadlines), started(DeviceDeadlines)
    due = host.next()
    host.arrived(sample(7 + DT + away, due + away), due - DT)
    device.next()
    device.arrived(sample(7 + 5 * DT, 100 + DT + away), 100 + DT + away - 1e-5)
    assert host.missed == device.missed == 4
    assert device.lateness == pytest.approx(host.lateness, abs=2e-6)


def test_a_device_with_a_slow_clock_is_neither_late_nor_losing() -> None:
    time = started(DeviceDeadlines)
    for k in range(1, 20_000):
        at = 100 + k * DT * (1 + 80e-6)
        time.next()
        time.arrived(sample(7 + k * DT, at), at - 0.9 * DT)
        assert (time.missed, time.lost) == (0, 0)
    assert judged(time) == NOTHING


@pytest.mark.parametrize("first_late", [0.0, 0.3, 0.5, 0.85])
def test_a_device_with_sampling_jitter_loses_no_sample(first_late: float) -> None:
    draw = random.Random(3)
    time = DeviceDeadlines(DT)
    time.start(sample(7 + first_late * DT, 100.0))
    for k in range(1, 5000):
        taken = k + (draw.uniform(0, 0.85) if draw.random() < 0.3 else draw.uniform(0, 0.002))
        time.arrived(sample(7 + taken * DT, 100 + taken * DT + 1e-4), 100 + (k - 0.9) * DT)
        assert (time.missed, time.lost) == (0, 0), k


@pytest.mark.parametrize("longer", [-3e-4, 3e-4])
def test_a_period_rounded_to_microseconds_is_no_loss(longer: float) -> None:
    time = started(DeviceDeadlines)
    for k in range(1, 20_000):
        at = k * DT * (1 + longer)
        time.arrived(sample(7 + at, 100 + at), 100 + at - 0.9 * DT)
        assert (time.missed, time.lost) == (0, 0), k


def test_losses_are_counted_under_sampling_jitter() -> None:
    draw = random.Random(4)
    time = started(DeviceDeadlines)
    k = lost = 0
    for _ in range(5000):
        gone = draw.choice([0, 0, 0, 0, 1, 2])
        k, lost = k + 1 + gone, lost + gone
        taken = k + draw.uniform(0, 0.3)
        time.arrived(sample(7 + taken * DT, 100 + taken * DT), 100 + (k - gone - 0.95) * DT)
        lost -= time.missed + time.lost
        assert lost == 0, k

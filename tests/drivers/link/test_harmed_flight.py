"""A run over a line that corrupts one frame in ten, both ways: it continues, and every sample is
true."""

from __future__ import annotations

import random
import time
from itertools import pairwise

import pytest
from heli3dof_drivers.link.rig import LinkRig

from heli3dof.rig.interface import Command, Flags
from heli3dof.rig.profile import default_profile
from tests.drivers.emulator.still import still_endpoint
from tests.drivers.link.faults import HarmfulLine, Tally
from tests.drivers.link.lines import DirectLine

pytestmark = pytest.mark.usefixtures("own_clock")
PROFILE = default_profile()
SHARE = 0.1


def harm(line: DirectLine, tally: Tally) -> None:
    """Corrupt frames from now on."""
    rng = random.Random(7)
    there, back = HarmfulLine(rng, SHARE, tally), HarmfulLine(rng, SHARE, tally)

    def over(wire: HarmfulLine, data: bytes) -> bytes:
        frames = [piece + b"\0" for piece in data.split(b"\0")[:-1]]
        return b"".join(bytes_ for frame in frames for bytes_, _ in wire.send(frame))

    line.to_device = lambda data: over(there, data)
    line.to_host = lambda data: over(back, data)


@pytest.mark.parametrize("stream", [True, False], ids=["stream", "poll"])
def test_every_sample_is_true_on_a_line_with_errors(stream: bool):
    line, tally = DirectLine(still_endpoint()), Tally()
    rig = LinkRig(line, PROFILE, driver="test", stream=stream, watchdog_s=0.4)
    samples, due = [rig.arm()], time.monotonic()
    harm(line, tally)
    volts = {0: (0.0, 0.0)}
    for k in range(1, 401):
        volts[k] = (k / 100, -k / 50)
        due = max(due + PROFILE.dt, time.monotonic())
        samples.append(rig.exchange(Command(k, *volts[k]), due))
    assert tally.faults > 50
    assert all(s.v_applied == volts[s.sequence] for s in samples)
    assert all(s.flags == Flags.ENABLED for s in samples)
    assert all(a.device_time_s < b.device_time_s for a, b in pairwise(samples))
    assert all(a.sequence <= b.sequence for a, b in pairwise(samples))
    statistics = rig.statistics
    assert min(statistics.malformed, statistics.lost, statistics.commands_unacknowledged) > 0
    rig.close()
    assert not line.endpoint.amplifier.enabled

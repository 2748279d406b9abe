"""A line that is slow with every frame (a busy bus, an emulated machine) is usable."""

from __future__ import annotations

import time

import pytest
from heli3dof_drivers.link.rig import LinkRig
from heli3dof_drivers.link.sampling import SHORTEST_RETRY_S

from heli3dof.rig.interface import Command, Flags
from heli3dof.rig.profile import default_profile
from tests.drivers.emulator.still import still_endpoint
from tests.drivers.link.lines import DirectLine

pytestmark = pytest.mark.usefixtures("own_clock")
PROFILE = default_profile()


class SlowLine(DirectLine):
    def write(self, data: bytes) -> None:
        super().write(data)
        time.sleep(1.6 * SHORTEST_RETRY_S)


@pytest.mark.parametrize("stream", [True, False], ids=["stream", "poll"])
def test_a_line_slower_than_the_retry_time_is_usable(stream: bool):
    line = SlowLine(still_endpoint())
    rig = LinkRig(line, PROFILE, driver="test", stream=stream, watchdog_s=0.5)
    assert rig.arm().flags == Flags.ENABLED
    for k in range(10):
        sample = rig.exchange(Command(k + 1, 5.0, 5.0), time.monotonic() + PROFILE.dt)
    assert sample.flags == Flags.ENABLED
    assert sample.v_applied == (5.0, 5.0)
    rig.close()

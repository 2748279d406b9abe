"""The host's side of the link against the emulated device, in one process."""

from __future__ import annotations

import time

import pytest
from heli3dof_drivers.link.rig import LinkRig

from heli3dof.rig.port import Command, Flags
from heli3dof.rig.profile import default_profile
from tests.drivers.emulator.still import still_endpoint
from tests.drivers.link.lines import DirectLine

PROFILE = default_profile()


def open_direct(*, stream: bool = True, **options) -> tuple[LinkRig, DirectLine]:
    line = DirectLine(still_endpoint())
    return LinkRig(line, PROFILE, driver="test", stream=stream, watchdog_s=0.4, **options), line


@pytest.mark.parametrize("stream", [True, False])
def test_it_arms_flies_and_closes(stream: bool):
    rig, line = open_direct(stream=stream)
    assert rig.identity.serial == "G1"
    assert rig.identity.boot == 1
    assert rig.read().flags == Flags(0)
    assert rig.arm().flags == Flags.ENABLED
    for k in range(1, 50):
        sample = rig.exchange(Command(k, 5.0, -5.0), time.monotonic() + PROFILE.dt)
        assert sample.sequence == k
        assert sample.v_applied == (5.0, -5.0)
    rig.close()
    assert line.closed
    assert line.endpoint.amplifier.output_uV(line.now_us) == (0, 0)

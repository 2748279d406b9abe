"""docs/reference/mock.md describes the emulated rig."""

from __future__ import annotations

from heli3dof_drivers.emulator.noise import CORRELATION_S, SIGMA_NM
from heli3dof_drivers.options import MockOptions

from tests.pages import mock_page

PAGE = mock_page.PAGE.read()


def test_every_option_is_listed():
    assert all(f"\n- `{option}`: " in PAGE for option in MockOptions.names())


def test_the_quoted_noise_is_the_emulators():
    roll, pitch, yaw = SIGMA_NM
    assert f"{roll:g}, {pitch:g} and {yaw:g} N·m" in PAGE
    assert f"correlation time of {1000 * CORRELATION_S:g} ms" in PAGE

"""docs/mock.md agrees with the emulated rig."""

from __future__ import annotations

from heli3dof_drivers.emulator.noise import CORRELATION_S, SIGMA_NM
from heli3dof_drivers.emulator.page import PAGE as MADE
from heli3dof_drivers.options import MockOptions

from tests.paths import ROOT

PAGE = (ROOT / "docs" / "mock.md").read_text(encoding="utf-8")


def test_the_tables_are_up_to_date():
    assert MADE.renewed(PAGE) == PAGE, "run: python -m heli3dof_drivers.emulator.page docs/mock.md"


def test_every_option_has_its_row():
    assert all(f"| `{option}` |" in PAGE for option in MockOptions.names())


def test_the_page_states_the_noise_of_the_emulated_rig():
    roll, pitch, yaw = SIGMA_NM
    assert f"{roll:g}, {pitch:g} and {yaw:g} N·m" in PAGE
    assert f"correlated over {1000 * CORRELATION_S:g} ms" in PAGE

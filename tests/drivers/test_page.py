"""docs/mock.md says what the emulated rig does."""

from __future__ import annotations

from heli3dof_drivers.emulator.noise import CORRELATION_S, SIGMA_NM
from heli3dof_drivers.emulator.page import PAGE as MADE
from heli3dof_drivers.mock import OPTIONS

from tests.paths import ROOT

PAGE = (ROOT / "docs" / "mock.md").read_text(encoding="utf-8")


def test_the_tables_are_those_of_what_there_is():
    assert MADE.renewed(PAGE) == PAGE, "run: python -m heli3dof_drivers.emulator.page docs/mock.md"


def test_every_option_has_its_row():
    assert all(f"| `{option}` |" in PAGE for option in OPTIONS)


def test_the_noise_it_quotes_is_the_noise_it_makes():
    roll, pitch, yaw = SIGMA_NM
    assert f"{roll:g}, {pitch:g} and {yaw:g} N·m" in PAGE
    assert f"correlated over {1000 * CORRELATION_S:g} ms" in PAGE

"""Numbers that a person reads have a true minus sign."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest

from heli3dof.cli import output_encoding
from tests.cli.running import heli3dof
from tests.paths import ROOT

FLIGHT = ROOT / "recordings" / "step-roll-10.mcap"
HYPHEN = re.compile(r"(?<![\w./-])-\d[^\n]*")


def test_the_doctests_pass() -> None:
    assert doctest.testmod(output_encoding).failed == 0


@pytest.mark.parametrize("words", [("info", FLIGHT), ("profile", "show")])
def test_no_number_is_printed_with_a_hyphen(words: tuple[object, ...]) -> None:
    result = heli3dof(*words)
    assert "−" in result.out
    assert HYPHEN.findall(result.out + result.err) == []


def test_a_preview_of_a_log_has_minus_signs(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    rows = "".join(f"{0.01 * k},-1,-2,{-27.5 + 0.1 * k}\n" for k in range(50))
    log.write_text(f"t_s,v_front_V,v_back_V,roll_deg\n{rows}", encoding="utf-8")
    profile = tmp_path / "rig.toml"
    shown = heli3dof("profile", "new", "--set", "loop.rate_hz=100", *NUMBERS, "-o", profile)
    assert shown.code == 0, shown.err
    result = heli3dof("import", log, "--profile", profile)
    assert "−27.5" in result.out
    assert HYPHEN.findall(result.out) == []


NUMBERS = [
    word
    for key in ("geometry.L_w=0.47", "geometry.L_a=0.66", "geometry.L_h=0.178", "mass.m_w=1.87",
                "mass.m_f=0.575", "mass.m_b=0.575", "motor.K_f=0.1188", "motor.V_o=7.456",
                "motor.v_max=24", "encoder.roll=4096", "encoder.pitch=4096", "encoder.yaw=8192")
    for word in ("--set", key)
]  # fmt: skip

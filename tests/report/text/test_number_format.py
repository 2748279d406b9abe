from __future__ import annotations

import doctest

from heli3dof.report.text import number_format


def test_the_doctests_pass() -> None:
    assert doctest.testmod(number_format).failed == 0

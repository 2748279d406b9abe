"""The doctests of device URLs."""

import doctest

from heli3dof.rig import url


def test_the_doctests_pass() -> None:
    assert doctest.testmod(url).failed == 0

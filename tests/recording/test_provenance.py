"""The doctests of provenance."""

import doctest

from heli3dof.recording import provenance


def test_the_doctests_pass() -> None:
    assert doctest.testmod(provenance).failed == 0

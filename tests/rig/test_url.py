"""Device URLs: doctests and errors."""

import doctest

import pytest

from heli3dof.errors import UsageError
from heli3dof.rig import url


@pytest.mark.parametrize("port", ["COM3", "/dev/ttyACM1"])
def test_a_port_without_a_scheme_is_named_with_it(port: str) -> None:
    with pytest.raises(UsageError) as caught:
        url.parse_url(port)
    assert caught.value.fix == f"--device serial://{port}"


def test_the_doctests_pass() -> None:
    assert doctest.testmod(url).failed == 0


def test_a_driver_without_options_says_so() -> None:
    with pytest.raises(UsageError, match="no option 'gain'") as caught:
        url.parse_url("lab://bench:4111?gain=3").check_options([])
    assert caught.value.cause == "this driver has no options."
    assert caught.value.fix == "--device lab://bench:4111"

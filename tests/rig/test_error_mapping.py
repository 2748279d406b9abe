"""What sockets and files raise, said as a driver owes it."""

from __future__ import annotations

import pytest

from heli3dof.errors import DeviceError
from heli3dof.rig.error_mapping import device_errors


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (ConnectionRefusedError(111, "Connection refused"), "lab://b: [Errno 111] Connection"),
        (ValueError("NO: another master.\n"), "lab://b: NO: another master."),
        (TimeoutError(), "lab://b: TimeoutError."),
    ],
)
def test_an_error_of_the_line_is_about_the_rig(raised: Exception, said: str):
    with pytest.raises(DeviceError) as caught, device_errors("lab://b", fix="switch it on"):
        raise raised
    assert caught.value.what.startswith(said)
    assert caught.value.cause
    assert caught.value.fix == "switch it on"
    assert caught.value.__cause__ is raised


def test_other_errors_are_left_alone():
    with pytest.raises(KeyError), device_errors("lab://b"):
        raise KeyError("ours")
    with pytest.raises(DeviceError, match="of its own"), device_errors("lab://b"):
        raise DeviceError("one of its own")

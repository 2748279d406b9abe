"""Errors of a port become DeviceErrors with a cause and a fix."""

from __future__ import annotations

import pytest

from heli3dof.errors import DeviceError
from heli3dof.rig.error_mapping import device_errors


@pytest.mark.parametrize(
    ("raised", "words"),
    [
        (ConnectionRefusedError(111, "Connection refused"), "lab://b: [Errno 111] Connection"),
        (ValueError("NO: another master.\n"), "lab://b: NO: another master."),
        (TimeoutError(), "lab://b: TimeoutError."),
    ],
)
def test_an_oserror_becomes_a_device_error_that_names_the_rig(raised: Exception, words: str):
    with pytest.raises(DeviceError) as caught, device_errors("lab://b", fix="switch it on"):
        raise raised
    assert caught.value.what.startswith(words)
    assert caught.value.cause
    assert caught.value.fix == "switch it on"
    assert caught.value.__cause__ is raised


def test_other_errors_pass_unchanged():
    with pytest.raises(KeyError), device_errors("lab://b"):
        raise KeyError("ours")
    with pytest.raises(DeviceError, match="of its own"), device_errors("lab://b"):
        raise DeviceError("one of its own")

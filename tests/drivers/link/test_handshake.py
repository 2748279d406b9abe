"""The device is identified and compared with the profile; each mismatch names its cause."""

from __future__ import annotations

import pytest
from cobs.cobs import encode
from heli3dof_drivers.link import handshake
from heli3dof_drivers.link.frames import Ack, Code, Hello, Type, check, parse, wire
from heli3dof_drivers.link.rig import LinkRig

from heli3dof.errors import DeviceError
from heli3dof.rig.profile import Profile, default_profile
from tests.drivers.emulator.still import still_endpoint
from tests.drivers.link.lines import DirectLine

pytestmark = pytest.mark.usefixtures("own_clock")
PROFILE = default_profile()


@pytest.fixture(autouse=True)
def _fewer_attempts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(handshake, "TRIES", 3)


def opening(line: DirectLine, profile: Profile = PROFILE, **options) -> LinkRig:
    return LinkRig(line, profile, driver="test", **options)


def with_counts(**encoder: int) -> Profile:
    return PROFILE.model_copy(update={"encoder": PROFILE.encoder.model_copy(update=encoder)})


def test_a_port_without_a_reply():
    line = DirectLine(still_endpoint())
    line.to_device = lambda data: b""
    with pytest.raises(DeviceError, match="no reply") as caught:
        opening(line)
    assert "switched off" in caught.value.cause
    assert line.closed


def test_a_port_with_another_device():
    line = DirectLine(still_endpoint())
    line.to_host = lambda data: b"GRBL 1.1 ready\r\n" if data else b""
    with pytest.raises(DeviceError, match=r"GRBL 1\.1") as caught:
        opening(line)
    assert "baud" in caught.value.fix


def test_a_device_that_refuses_the_protocol_version():
    line = DirectLine(still_endpoint())

    def answer(data: bytes) -> bytes:
        for piece in data.split(b"\0"):
            hello = parse(piece)
            if isinstance(hello, Hello):
                line._waiting += wire(Ack(hello.number, Type.HELLO, Code.VERSION, 0, 0, 1))
        return b""

    line.to_device = answer
    with pytest.raises(DeviceError, match="other versions only") as caught:
        opening(line)
    assert "firmware" in caught.value.fix


def test_a_device_whose_frames_are_of_another_version():
    data = bytes([2, Type.ACK, 1, 0, 0, 0, 0, 0])
    line = DirectLine(still_endpoint())
    line.to_host = lambda sent: sent and encode(data + check(data)) + b"\0"
    with pytest.raises(DeviceError, match="version 2 of the link's protocol"):
        opening(line)


def test_noise_and_a_torn_frame_before_the_first_request_do_no_harm():
    line = DirectLine(still_endpoint())
    line.endpoint.receive(0, wire(Hello(3))[:6])
    line._waiting = b"\x07noise"
    assert opening(line).identity.model == "golden device"


@pytest.mark.parametrize("axis", ["roll", "pitch", "yaw"])
def test_an_encoder_of_another_resolution_is_named_by_its_key(axis: str):
    with pytest.raises(DeviceError, match=rf"encoder\.{axis} = 1024"):
        opening(DirectLine(still_endpoint()), with_counts(**{axis: 1024}))


def test_a_reversed_encoder_is_an_error_unless_the_url_says_signs_profile():
    other = with_counts(yaw=-8192)
    with pytest.raises(DeviceError, match=r"encoder\.yaw = -8192") as caught:
        opening(DirectLine(still_endpoint()), other)
    assert "?signs=profile" in caught.value.fix
    assert opening(DirectLine(still_endpoint()), other, signs="profile").identity.serial == "G1"


def test_a_voltage_limit_above_the_devices_is_an_error_and_one_below_is_not():
    def limited_to(v_max: float) -> Profile:
        motor = PROFILE.motor.model_copy(update={"v_max": v_max})
        return PROFILE.model_copy(update={"motor": motor})

    with pytest.raises(DeviceError, match=r"motor\.v_max = 30"):
        opening(DirectLine(still_endpoint()), limited_to(30.0))
    assert opening(DirectLine(still_endpoint()), limited_to(12.0)).identity.v_max == 24.0


def test_a_rate_above_the_devices_is_an_error():
    loop = PROFILE.loop.model_copy(update={"rate_hz": 4000.0})
    with pytest.raises(DeviceError, match=r"loop\.rate_hz = 4000") as caught:
        opening(DirectLine(still_endpoint()), PROFILE.model_copy(update={"loop": loop}))
    assert "2000" in caught.value.fix

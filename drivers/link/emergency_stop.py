"""The emergency stop: sent in any state until the device confirms it."""

from __future__ import annotations

import time
from collections.abc import Callable

from heli3dof.rig.interface import Flags

from .errors import not_stopped
from .frames import Ack, Estop, Frame, SampleFrame, Type, wire
from .request_reply import RequestClient
from .transport import Transport

STOP_EVERY_S = 20e-3
STOP_TRIES = 25
SHARED_TRIES = 10
"""Where another program holds the line: bytes read here are missing there."""


def ack_of(request: Type) -> Callable[[Frame, set[int]], Ack | None]:
    """A function that returns a frame if it is the ACK of one of these requests, else None."""

    def match(frame: Frame, numbers: set[int]) -> Ack | None:
        if isinstance(frame, Ack) and frame.request == request and frame.number in numbers:
            return frame
        return None

    return match


def stop(client: RequestClient, tries: int = STOP_TRIES) -> bool:
    """True when the device has acknowledged the stop, or a sample shows it stopped.

    On a shared line the other program reads most replies; the repeated samples still get through.
    """
    is_ack = ack_of(Type.ESTOP)
    numbers: set[int] = set()
    for attempt in range(tries):
        number = client.next_number()
        numbers.add(number)
        client.statistics.retries += attempt > 0
        client.send(wire(Estop(number)))
        until = time.monotonic() + STOP_EVERY_S
        while (left := until - time.monotonic()) > 0:
            if any(is_ack(frame, numbers) for frame in client.receive(left)):
                return True
            if any(_is_stopped(sample) for sample, _ in client.samples):
                return True
    return False


def _is_stopped(sample: SampleFrame) -> bool:
    return bool(sample.flags & Flags.ESTOP) and not sample.flags & Flags.ENABLED


def stop_over(transport: Transport, *, shared: bool = False) -> str:
    """Stop the device at the other end; returns a line for the user.

    ``shared``: another program holds this line and may read the reply. Raises DeviceError where
    nothing confirms the stop.
    """
    tries = SHARED_TRIES if shared else STOP_TRIES
    if not stop(RequestClient(transport), tries):
        raise not_stopped(transport.name, tries, shared=shared)
    return f"{transport.name}: stopped; the rig confirmed it"

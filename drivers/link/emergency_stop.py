"""Sends the emergency stop (ESTOP frames) until the device confirms it or the attempts end."""

from __future__ import annotations

import time
from collections.abc import Callable

from heli3dof.rig.interface import Flags

from .errors import not_stopped
from .frames import Ack, Estop, Frame, SampleFrame, Type, wire
from .request_reply import RequestClient, Transport

STOP_EVERY_S = 20e-3
"""s between two ESTOP frames"""
STOP_TRIES = 25
SHARED_TRIES = 10
"""Largest numbers of ESTOP frames. `SHARED_TRIES` applies to a device that no longer replies, and
to one whose port another program has open. It is smaller because that program never receives the
bytes that this one reads"""


def ack_of(request: Type) -> Callable[[Frame, set[int]], Ack | None]:
    """Return a function that recognises the ACK of a request of type ``request``.

    The function takes a frame and a set of request numbers. It returns the frame if this is the ACK
    of such a request with one of the numbers, else None.
    """

    def match(frame: Frame, numbers: set[int]) -> Ack | None:
        if isinstance(frame, Ack) and frame.request == request and frame.number in numbers:
            return frame
        return None

    return match


def stop(client: RequestClient, tries: int = STOP_TRIES) -> bool:
    """Send the emergency stop, up to ``tries`` times, `STOP_EVERY_S` seconds apart.

    Returns True once an ACK or a sample shows that the device has stopped, else False. If another
    program reads from the same port, this program receives only some of the replies and samples.
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
    """Stop the device at the other end of ``transport``; return a message for the user.

    ``shared``: another program has the same port open and may read the reply. Raises DeviceError if
    neither an ACK nor a sample confirms the stop.
    """
    tries = SHARED_TRIES if shared else STOP_TRIES
    if not stop(RequestClient(transport), tries):
        raise not_stopped(transport.name, tries, shared=shared)
    return f"{transport.name}: stopped; the rig confirmed it"

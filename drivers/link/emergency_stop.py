"""Sends the emergency stop (ESTOP frames) until the device confirms it or the attempts end."""

from __future__ import annotations

import time

from heli3dof.rig.interface import Flags

from .errors import not_stopped
from .frames import Ack, Estop, Type, wire
from .request_reply import RequestClient, Transport

STOP_EVERY_S = 20e-3
"""s between two ESTOP frames"""
STOP_TRIES = 25
SHARED_TRIES = 10
"""Largest numbers of ESTOP frames. `SHARED_TRIES` applies to a device that no longer replies, and
to one whose port another program has open. It is smaller because that program never receives the
bytes that this one reads"""


def stop(client: RequestClient, tries: int = STOP_TRIES) -> bool:
    """Send the emergency stop, up to ``tries`` times, `STOP_EVERY_S` seconds apart.

    Returns True once an ACK or a sample shows that the device has stopped, else False. If another
    program also reads from the port, it may receive the ACK and the samples. The result may then be
    False although the device has stopped.
    """
    numbers: set[int] = set()
    for attempt in range(tries):
        number = client.next_number()
        numbers.add(number)
        client.statistics.retries += attempt > 0
        client.send(wire(Estop(number)))
        until = time.monotonic() + STOP_EVERY_S
        while (left := until - time.monotonic()) > 0:
            acks = [f for f in client.receive(left) if isinstance(f, Ack)]
            if any(a.request == Type.ESTOP and a.number in numbers for a in acks):
                return True
            flags = [sample.flags for sample, _ in client.samples]
            if any(f & Flags.ESTOP and not f & Flags.ENABLED for f in flags):
                return True
    return False


def stop_over(transport: Transport, *, shared: bool = False) -> str:
    """Stop the device at the other end of ``transport``; return a message for the user.

    ``shared``: another program has the same port open and may read the reply. Raises DeviceError if
    neither an ACK nor a sample confirms the stop.
    """
    tries = SHARED_TRIES if shared else STOP_TRIES
    if not stop(RequestClient(transport), tries):
        raise not_stopped(transport.name, tries, shared=shared)
    return f"{transport.name}: stopped; the rig confirmed it"

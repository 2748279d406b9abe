"""The emergency stop: sent until the device says that it has obeyed, in whatever state it is."""

from __future__ import annotations

import time
from collections.abc import Callable

from heli3dof.rig.interface import Flags

from .errors import not_stopped
from .frames import Ack, Estop, Frame, SampleFrame, Type, wire
from .request_reply import Dialogue
from .transport import Transport

STOP_EVERY_S = 20e-3
STOP_TRIES = 25
BESIDE_TRIES = 10
"""Where another program holds the line: every byte read here is missing there."""


def ack_of(request: Type) -> Callable[[Frame, set[int]], Ack | None]:
    """Recognises the ACK of one of our requests of this type."""

    def answer(frame: Frame, numbers: set[int]) -> Ack | None:
        if isinstance(frame, Ack) and frame.request == request and frame.number in numbers:
            return frame
        return None

    return answer


def stop(dialogue: Dialogue, tries: int = STOP_TRIES) -> bool:
    """True when the device has acknowledged it, or a sample says that it stands stopped.

    Beside another program the samples are what comes through: that one reads most of the bytes.
    """
    is_ack = ack_of(Type.ESTOP)
    numbers: set[int] = set()
    for attempt in range(tries):
        number = dialogue.next_number()
        numbers.add(number)
        dialogue.statistics.repeats += attempt > 0
        dialogue.send(wire(Estop(number)))
        until = time.monotonic() + STOP_EVERY_S
        while (left := until - time.monotonic()) > 0:
            if any(is_ack(frame, numbers) for frame in dialogue.receive(left)):
                return True
            if any(_stands(sample) for sample, _ in dialogue.samples):
                return True
    return False


def _stands(sample: SampleFrame) -> bool:
    return bool(sample.flags & Flags.ESTOP) and not sample.flags & Flags.ENABLED


def stop_over(transport: Transport, *, beside: bool = False) -> str:
    """Stop the device at the other end, and say so.

    ``beside``: another program holds this line, and may be the one that reads the answer. Raises
    DeviceError where nothing confirms the stop.
    """
    tries = BESIDE_TRIES if beside else STOP_TRIES
    if not stop(Dialogue(transport), tries):
        raise not_stopped(transport.name, tries, beside=beside)
    return f"{transport.name}: stopped, and the rig says so"

"""The emergency stop: sent until the device says that it has obeyed, in whatever state it is."""

from __future__ import annotations

from collections.abc import Callable

from .dialogue import Dialogue
from .frames import Ack, Estop, Frame, Type
from .transport import Transport

STOP_EVERY_S = 20e-3
STOP_TRIES = 25
BESIDE_TRIES = 3
"""Where another program holds the line: every byte read here is missing there."""


def ack_of(request: Type) -> Callable[[Frame, set[int]], Ack | None]:
    """Recognises the ACK of one of our requests of this type."""

    def answer(frame: Frame, numbers: set[int]) -> Ack | None:
        if isinstance(frame, Ack) and frame.request == request and frame.number in numbers:
            return frame
        return None

    return answer


def stop(dialogue: Dialogue, tries: int = STOP_TRIES) -> bool:
    """True when the device has acknowledged it."""
    acked = dialogue.ask(Estop, ack_of(Type.ESTOP), tries=tries, patience_s=STOP_EVERY_S)
    return acked is not None


def stop_over(transport: Transport, *, beside: bool = False) -> str:
    """Stop the device at the other end; what came of it. Raises DeviceError as the line does.

    ``beside``: another program holds this line, and may be the one that reads the answer.
    """
    tries = BESIDE_TRIES if beside else STOP_TRIES
    if stop(Dialogue(transport), tries):
        return f"{transport.name}: stopped, and the rig says so"
    return f"{transport.name}: the stop was sent {tries} times; no acknowledgement was seen" + (
        " (the program that holds the port may have read it)" if beside else ""
    )

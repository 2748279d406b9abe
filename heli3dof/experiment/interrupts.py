"""Ctrl-C and SIGTERM ask the loop to end; they never cut a control period in two."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

ASKED = {
    signal.SIGINT: "stopped with Ctrl-C",
    signal.SIGTERM: "stopped by a request to terminate (SIGTERM)",
}


@contextmanager
def asked_to_stop() -> Iterator[Callable[[], str | None]]:
    """A function that says why to stop, once a signal came; None before.

    Signals may only be caught in the main thread; elsewhere the function always says None.
    """
    asked: list[str] = []

    def catch(number: int, frame: FrameType | None) -> None:
        asked.append(ASKED[signal.Signals(number)])

    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return
    before = {number: signal.signal(number, catch) for number in ASKED}
    try:
        yield lambda: asked[0] if asked else None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

"""`Engine`: interface of the classes that call a function for many items in parallel processes."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Protocol, TypeVar

T = TypeVar("T")
R = TypeVar("R")

AHEAD = 2
"""Number of items queued for each worker, so that no worker waits for this process. Chosen: more
would only fill the memory with the contents of files."""


@dataclass(frozen=True)
class Lost:
    """Replaces the result of an item if several workers crashed on this item, one after another.

    A worker is a process. It may crash, for example, because the memory is full.
    """

    why: str
    """What happened, as text for a message"""


class Engine(Protocol):
    """Calls a function for many items in parallel, in processes on this computer or on a cluster.

    `run` may be called several times, but not before the previous call has ended.
    """

    remote: bool
    """True if the workers may not see this machine's files"""

    @property
    def workers(self) -> int:
        """Return the number of items that are processed at the same time."""
        ...

    def run(self, work: Callable[[T], R], items: Iterable[T]) -> Generator[tuple[int, R | Lost]]:
        """Yield (index of the item, ``work(item)``) in the order in which the calls finish.

        The workers must be able to import ``work``; on a cluster, it is enough that cloudpickle can
        pickle it. `run` raises an exception that ``work`` raises. It reads the next items as
        workers become free. If the caller stops early, calls that have not started are cancelled.
        """
        ...

"""`Engine`: distributes independent work and yields its results as they arrive."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

T = TypeVar("T")
R = TypeVar("R")

AHEAD = 2
"""Number of items queued for each worker, so that no worker waits for this process. Chosen: more
would only fill the memory with the contents of files."""


@dataclass(frozen=True)
class Lost:
    """Yielded in place of an item's result if several workers ended while working on the item."""

    why: str


class Engine(Protocol):
    """Distributes work. `run` may be called several times, one call after another."""

    remote: bool
    """True if the workers may not see this machine's files"""

    @property
    def workers(self) -> int:
        """Return how many items are worked on at the same time."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *error: object) -> None: ...

    def run(self, work: Callable[[T], R], items: Iterable[T]) -> Generator[tuple[int, R | Lost]]:
        """Yield (number of the item from 0, ``work(item)``) in the order in which the calls finish.

        ``work`` must be importable in the workers, or picklable with cloudpickle on a cluster. An
        exception of ``work`` is raised here. The next items are read as workers become free. If the
        caller stops early, calls that have not started are cancelled.
        """
        ...

"""`Importer`, a log format that can be read, and `Table`, the columns that it reads."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from heli3dof.rig.profile import Profile


@dataclass(frozen=True)
class Table:
    """The columns of a log as an importer read them. Each column is an array of N samples."""

    source: str
    """The file's name, for messages"""
    columns: Mapping[str, np.ndarray]
    """Column's name in the log → array (N,). The name usually includes the unit: ``roll_deg``"""
    where: Callable[[int], str]
    """Returns the position of sample k in the file, for messages: ``line 12``"""
    warnings: list[str] = field(default_factory=list)
    profile: Profile | None = None
    """The rig's profile, if the file contains one"""
    origins: Mapping[str, str] = field(default_factory=dict)
    """Column → its name in the log, or the expression from which it was computed; a column that is
    not listed has the same name in the log"""
    ignored: Sequence[str] = ()
    """Names of the columns that were left out, each with the reason"""
    means: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Column → its mean from each row to the next. Only columns of a log that was faster than the
    joined table are listed; voltages use the means."""
    paths: Mapping[str, str] = field(default_factory=dict)
    """Full path in the log, such as ``flight.angle.roll`` → column; ``--map`` accepts both names"""
    notes: Sequence[str] = ()
    """How the file was read, for the import's preview; unlike warnings, not kept in recordings"""

    def __len__(self) -> int:
        """Return the number of samples N."""
        return len(next(iter(self.columns.values()), ()))


@dataclass(frozen=True)
class Importer:
    """A log format: its file names' endings, and a function that reads a file as a `Table`."""

    name: str
    endings: tuple[str, ...]
    """Endings of the format's file names, such as ``(".csv", ".csv.gz")``, in any case"""
    read: Callable[[Path, Profile | None, str | Sequence[str] | None], Table]
    """``read(path, profile, columns)`` returns the file's table. ``columns`` is the option
    ``--columns``. Raises RecordingError or UsageError with a cause and a fix; any other exception
    becomes a RecordingError that names the file, the importer and the exception."""
    recognises: Callable[[Path], bool] | None = None
    """Returns True if a file has this format; None: its name's ending decides. An exception counts
    as False."""
    read_tables: Callable[[Path], Sequence[Table]] | None = None
    """Returns one table per time vector of a file; ``read`` joins these tables. With
    ``read_tables``, the import can leave out tables that no mapping needs
    (`joined_tables.join_used`)."""
    carries_profile: bool = False
    """True if ``read`` can return the rig's profile; other formats need ``--profile``"""

    def __post_init__(self) -> None:
        if not isinstance(self.endings, tuple):
            raise TypeError(f"{self.name}: endings is not a tuple; a single one needs a comma")
        object.__setattr__(self, "endings", tuple(e.lower() for e in self.endings))

    def sniff(self, path: Path) -> bool:
        """Return True if ``path`` is a file of this log format, by its content or its ending."""
        if self.recognises is None:
            return path.name.lower().endswith(self.endings)
        try:
            return self.recognises(path)
        except OSError:
            return False
        except (Exception, SystemExit) as error:  # other importers may read the file
            logging.getLogger("heli3dof").warning(
                "Warning: the importer %s cannot examine %s: %s: %s. It is left out.",
                self.name, path, type(error).__name__, error,
            )  # fmt: skip
            return False

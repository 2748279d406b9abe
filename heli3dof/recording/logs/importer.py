"""What an importer is (`Importer`) and what it returns (`Table`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from heli3dof.rig.profile import Profile


@dataclass(frozen=True)
class Table:
    """The columns of a log as they were read, each (N,), under their names with units."""

    source: str
    """The file's name, for messages"""
    columns: Mapping[str, np.ndarray]
    where: Callable[[int], str]
    """The position of sample k in the file: ``line 12`` of a CSV file"""
    warnings: list[str] = field(default_factory=list)
    profile: Profile | None = None
    """The rig's profile, for a format that can carry one"""


@dataclass(frozen=True)
class Importer:
    """One log format."""

    name: str
    endings: tuple[str, ...]
    """What its file names end in, lower case: ``(".csv", ".csv.gz")``"""
    read: Callable[[Path, Profile | None, str | Sequence[str] | None], Table]
    """``read(path, profile, columns)``: the file's table. ``columns`` is the option
    ``--columns``. Raises RecordingError, UsageError."""
    recognises: Callable[[Path], bool] | None = None
    """Whether a file has this format; by default its name's ending decides."""
    carries_profile: bool = False
    """Whether files may hold a profile, so that none has to be named"""

    def sniff(self, path: Path) -> bool:
        """True for a file of this format. The file need not exist."""
        if self.recognises is not None:
            return self.recognises(path)
        return path.name.lower().endswith(self.endings)

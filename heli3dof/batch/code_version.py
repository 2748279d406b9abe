"""The version of heli3dof with a hash of its code.

A resumed batch repeats the tasks whose results are from other code.
"""

from __future__ import annotations

import hashlib
from functools import cache
from importlib import metadata
from pathlib import Path

import heli3dof

ENDINGS = (".py", ".toml", ".json")


@cache
def code_version() -> str:
    """Return the version and 12 digits of the code's SHA-256, as in 0.1.0+1f0c5a7e93b2."""
    folder = Path(heli3dof.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.suffix in ENDINGS):
        digest.update(path.relative_to(folder).as_posix().encode())
        digest.update(path.read_bytes())
    return f"{metadata.version('heli3dof')}+{digest.hexdigest()[:12]}"

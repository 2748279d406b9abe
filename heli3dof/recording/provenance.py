"""Where a recording comes from: what anyone needs to judge it, or to make it again."""

from __future__ import annotations

import dataclasses
import platform
import subprocess
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from heli3dof.recording.mcap_files.schema import FORMAT
from heli3dof.rig.interface import Identity

PACKAGES = ("heli3dof", "numpy", "scipy", "mcap")


def provenance(
    *,
    source: str,
    plan: Any = None,
    seed: int | None = None,
    identity: Identity | None = None,
    device: str | None = None,
    named_host: bool = True,
    **more: Any,
) -> dict[str, Any]:
    """The start of ``Recording.meta``: JSON-able, known before the first sample.

    ``source`` is ``flight``, ``simulation`` or ``import``; ``device`` its URL; ``identity`` what
    the rig answered. ``named_host=False`` leaves out what tells the machine (host, command line),
    for recordings that are published. ``more`` is added as it is.
    """
    now = datetime.now(UTC)
    meta: dict[str, Any] = {
        "format": FORMAT,
        "source": source,
        "started_utc": now.isoformat(timespec="milliseconds"),
        "plan": plan,
        "seed": seed,
        "device": device,
        "identity": None if identity is None else dataclasses.asdict(identity),
        "versions": versions(),
        "git": git_state(),
    }
    if named_host:
        meta["host"] = platform.node()
        meta["command_line"] = list(sys.argv)
    meta.update(more)
    return {key: value for key, value in meta.items() if value is not None}


def seeds(plan: int, device: int | None, *, plan_draws: bool) -> dict[str, Any]:
    """What was drawn at random, and from which seed; ``seed`` sums it up in one number.

    A plan of steps draws nothing, nor does a real rig: their seeds are None. ``seed`` is the
    plan's where it draws, else the emulated rig's, else the one that was asked for.
    """
    each = {"plan": plan if plan_draws else None, "device": device}
    return {"seed": next((s for s in each.values() if s is not None), plan), "seeds": each}


@cache
def versions() -> Mapping[str, str]:
    """Versions of Python, the system and the packages that shape a recording."""
    found = {"python": platform.python_version(), "system": platform.system()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


@cache
def git_state() -> Mapping[str, Any] | None:
    """Revision and dirty flag where heli3dof runs from a checkout, else None."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None
    try:
        revision = _git(root, "rev-parse", "HEAD")
        dirty = bool(_git(root, "status", "--porcelain", "--untracked-files=no"))
    except (OSError, subprocess.SubprocessError):
        return None
    return {"revision": revision, "dirty": dirty}


def _git(root: Path, *words: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(root), *words], capture_output=True, text=True, timeout=5, check=True
    )
    return done.stdout.strip()

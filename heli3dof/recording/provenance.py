"""The provenance of a recording: source, versions, seeds and commands to reproduce it."""

from __future__ import annotations

import dataclasses
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heli3dof.errors import quoted
from heli3dof.recording.mcap_files.schema import FORMAT
from heli3dof.rig.interface import Identity
from heli3dof.rig.profile import default_profile

if TYPE_CHECKING:
    from heli3dof.recording.recording import Recording

PROFILE_FILE = "profile_file"
"""Key of `Recording.meta`: the file of ``--profile``, or else the recording itself, which contains
the profile; only verbs set it"""
PACKAGES = ("heli3dof", "numpy", "scipy", "mcap")


def provenance(
    *,
    source: str,
    plan: Any = None,
    seed: int | None = None,
    identity: Identity | None = None,
    device: str | None = None,
    **more: Any,
) -> dict[str, Any]:
    """Return a recording's provenance: a JSON-able dict, the first entries of ``Recording.meta``.

    ``source`` is ``flight``, ``simulation`` or ``import``; ``plan`` the experiment plan flown;
    ``seed`` the seed of the plan's random signals; ``device`` the rig's URL; ``identity`` what the
    rig reports about itself. ``more``: further entries. Entries that are None are omitted.
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
        "host": platform.node(),
        "command_line": list(sys.argv),
        **more,
    }
    return {key: value for key, value in meta.items() if value is not None}


def seeds(plan: int, device: int | None, *, plan_draws: bool) -> dict[str, Any]:
    """Return the entries ``seeds`` and ``seed`` of ``Recording.meta``, a recording's provenance.

    ``plan`` is the requested seed of the experiment plan, ``device`` that of the emulated rig (None
    for a real rig). ``plan_draws`` is True if the plan contains random signals.

    * ``seeds``: {"plan": ``plan``, or None without random signals; "device": ``device``}
    * ``seed``: the first of these two seeds that is not None; if both are None, ``plan``
    """
    each = {"plan": plan if plan_draws else None, "device": device}
    return {"seed": next((s for s in each.values() if s is not None), plan), "seeds": each}


def profile_file(recordings: Sequence[Recording]) -> str | None:
    """Return the path of the recordings' profile, for a command that flies the same rig again.

    The result is None if the recordings have the default profile, which the command uses without
    ``--profile``. The comparison with the default profile leaves out the limits, because default
    limits differ between versions of heli3dof. The result is the placeholder ``PROFILE.toml`` if
    a path is unknown. If the paths differ, it is that of the first recording.
    """
    default = default_profile()
    same_limits = {"limits": default.limits}
    if all(r.profile.model_copy(update=same_limits) == default for r in recordings):
        return None
    files = [r.meta.get(PROFILE_FILE) for r in recordings]
    return str(files[0]) if files and all(files) else "PROFILE.toml"


def rig_to_fly(recordings: Sequence[Recording]) -> dict[str, str]:
    """Return ``device`` (a URL) and ``profile`` (a file) for a further flight of this rig.

    The dict has no entry for an unknown device, nor for the default profile.
    """
    from heli3dof.rig.url import url_of_next_flight

    url = url_of_next_flight({str(r.meta.get("device") or "") for r in recordings})
    entries = {"device": url, "profile": profile_file(recordings)}
    return {key: value for key, value in entries.items() if value}


def exercise_ids(recordings: Sequence[Recording]) -> list[str | None] | None:
    """Return the id of each recording's exercise; None if no recording is of an exercise.

    An exercise is a rig with hidden effects, for students. The id is None for any other rig.
    """
    from heli3dof.rig.sealed_rig import exercise_of

    identities = [r.meta.get("identity") for r in recordings]
    ids = [
        exercise_of(str(i.get("serial"))) if isinstance(i, Mapping) else None for i in identities
    ]
    return ids if any(ids) else None


def run_command(plan: str, device: str | None, profile: str | None) -> str:
    """Return the command that flies a ``plan`` on a rig; ``device`` is a URL, ``profile`` a file.

    >>> run_command("rich", None, "lab 2.toml")
    "heli3dof run rich --profile 'lab 2.toml'"
    """
    options = {"--device": device, "--profile": profile}
    given = (f" {name} {quoted(value)}" for name, value in options.items() if value)
    return f"heli3dof run {plan}{''.join(given)}"


@cache
def versions() -> Mapping[str, str]:
    """Return {name: version} of Python and `PACKAGES`, and {"system": operating system}."""
    found = {"python": platform.python_version(), "system": platform.system()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


@cache
def git_state() -> Mapping[str, Any] | None:
    """Return the Git revision of heli3dof's checkout, and whether its files are modified.

    The result is None if there is no checkout or Git is missing.
    """
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

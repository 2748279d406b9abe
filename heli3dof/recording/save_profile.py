"""`save_profile`: writes a profile as a commented TOML file."""

from __future__ import annotations

from pathlib import Path

from heli3dof.recording.atomic_write import check_ending, write_file
from heli3dof.rig.profile import Profile
from heli3dof.rig.profile_file import new_text


def save_profile(profile: Profile, path: str | Path, *, force: bool = False) -> Path:
    """Write a profile to the TOML file ``path`` and return the path.

    To change a number, edit the dict of the profile::

        data = profile.to_dict()
        data["motor"]["K_f"] = 0.12
        save_profile(profile_from_dict(data), "rig.toml")

    Raises OutputExists if the file exists and ``force`` is not set, UsageError if the name has
    another format's ending, and UsageError or NoSpace if the file cannot be written.
    """
    check_ending(Path(path), ".toml")
    return write_file(path, new_text(profile.to_dict()).encode(), force=force)

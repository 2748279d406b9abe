"""Complete what a person types at a shell's prompt: devices, plans, models, effects and files.

``heli3dof --install-completion`` sets the shell up. Each function returns the possible words that
start with ``incomplete``, the text typed so far.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def devices(incomplete: str) -> list[str]:
    """Return the URLs of the rigs found, and each driver's URL scheme, such as ``serial:``."""
    from heli3dof.rig.drivers import find_rigs

    found = [(scheme, urls) for scheme, urls, _ in find_rigs()]
    return starting(incomplete, (w for scheme, urls in found for w in (*urls, f"{scheme}:")))


def plans(incomplete: str) -> list[str]:
    from heli3dof.experiment.plan import named_plans

    return starting(incomplete, named_plans()) + files(incomplete, ".toml")


def models(incomplete: str) -> list[str]:
    from heli3dof.paper.models import BUILT_IN

    return starting(incomplete, BUILT_IN) + files(incomplete, ".json")


def recordings(incomplete: str) -> list[str]:
    return files(incomplete, ".mcap", ".csv", ".mat")


def recordings_and_models(incomplete: str) -> list[str]:
    return recordings(incomplete) + models(incomplete)


def terms(incomplete: str) -> list[str]:
    """Complete the last effect in a comma-separated list: ``+friction.viscous.roll,+aero``."""
    from heli3dof.model.effects import all_names

    before, comma, _ = incomplete.rpartition(",")
    return starting(
        incomplete, (f"{before}{comma}{sign}{name}" for name in all_names() for sign in "+-")
    )


def files(incomplete: str, *suffixes: str) -> list[str]:
    """Return folders (ending in ``/``) and files with one of the ``suffixes``."""
    before, slash, _ = incomplete.rpartition("/")
    prefix = before + slash
    try:
        entries = sorted(Path(prefix or ".").iterdir())
    except OSError:
        return []
    names = (
        f"{prefix}{p.name}/" if p.is_dir() else f"{prefix}{p.name}"
        for p in entries
        if (p.is_dir() or p.suffix in suffixes) and not p.name.startswith(".")
    )
    return starting(incomplete, names)


def starting(incomplete: str, words: Iterable[str]) -> list[str]:
    return sorted({w for w in words if w.startswith(incomplete)})

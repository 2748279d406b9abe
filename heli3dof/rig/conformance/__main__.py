"""``python -m heli3dof.rig.conformance URL``: run every case on one rig, one line each.

A case also fails if the driver raises an exception that is no `Heli3dofError`. The case's line then
names the exception and where it was raised.

Exit code: 0 if no case failed, else the highest code that applies: 6 if the driver violates a
requirement, 3 if it raises a DeviceError, 2 if it raises a UsageError, e.g. for an invalid URL.
"""

from __future__ import annotations

import argparse
import sys
import traceback
import unittest
from pathlib import Path

from heli3dof.errors import Heli3dofError
from heli3dof.rig.conformance import CASES, NotConforming, conforms
from heli3dof.rig.conformance.bench import MovesRealRig
from heli3dof.rig.drivers import load_driver
from heli3dof.rig.profile import default_profile, load_profile
from heli3dof.rig.url import parse_url


def main(arguments: list[str] | None = None) -> int:
    """Run every case on one rig and print the results; return the exit code.

    ``arguments``: words of the command line; None: the words with which the user started this
    process.
    """
    parser = argparse.ArgumentParser(
        prog="python -m heli3dof.rig.conformance",
        description="Check the requirements on a driver, on one rig.",
    )
    parser.add_argument("url", help="the device URL")
    parser.add_argument("--profile", type=Path, help="the rig's profile (TOML)")
    parser.add_argument(
        "--moves",
        action="store_true",
        help="let a real rig's motors move, up to their limit for a period: stand clear",
    )
    given = parser.parse_args(arguments)
    worst = not_moved = 0
    try:
        load_driver(parse_url(given.url).scheme)
        profile = load_profile(given.profile) if given.profile else default_profile()
    except Heli3dofError as problem:
        print(problem, file=sys.stderr)
        return problem.exit_code
    for case in CASES:
        try:
            conforms(case, given.url, profile, moves=True if given.moves else None)
            result = "holds"
        except unittest.SkipTest as reason:
            result = f"skipped: {reason}"
            not_moved += isinstance(reason, MovesRealRig)
        except Heli3dofError as problem:
            message = problem.what if isinstance(problem, NotConforming) else str(problem)
            result, worst = f"FAILS: {message}", max(worst, problem.exit_code)
        except Exception as problem:
            result = f"FAILS: the driver raised {_described(problem)}"
            worst = max(worst, NotConforming.exit_code)
        print(f"{str(case).replace('_', ' ')}: {result}", flush=True)
    if not_moved:
        print(f"{not_moved} cases skipped: they move a real rig. Stand clear and add --moves.")
    return worst


def _described(problem: Exception) -> str:
    """Return an exception's name, message and place (file and line) as one text."""
    name = type(problem).__name__
    at = traceback.extract_tb(problem.__traceback__)[-1]
    place = f"{Path(at.filename).name}, line {at.lineno}, in {at.name}"
    return f"{name}: {problem} ({place})"


if __name__ == "__main__":
    sys.exit(main())

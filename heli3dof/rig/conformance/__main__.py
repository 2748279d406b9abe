"""``python -m heli3dof.rig.conformance URL``: run every case on one rig, one line each.

Exit 0: every case holds · 6: one fails · 2, 3: the URL or its rig cannot be used.
"""

from __future__ import annotations

import argparse
import sys
import unittest
from pathlib import Path

from heli3dof.errors import Heli3dofError
from heli3dof.rig.conformance import CASES, NotConforming, conforms
from heli3dof.rig.drivers import load_driver
from heli3dof.rig.profile import default_profile, load_profile
from heli3dof.rig.url import parse_url


def main(arguments: list[str] | None = None) -> int:
    """Print the result of each case; returns the exit code."""
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
    worst = 0
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
        except Heli3dofError as problem:
            message = problem.what if isinstance(problem, NotConforming) else str(problem)
            result, worst = f"FAILS: {message}", max(worst, problem.exit_code)
        print(f"{str(case).replace('_', ' ')}: {result}", flush=True)
    return worst


if __name__ == "__main__":
    sys.exit(main())

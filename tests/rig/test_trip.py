"""A trip states what was observed, the likely cause and a fix."""

from __future__ import annotations

import ast
from collections import Counter

import heli3dof
from heli3dof.rig.trip import Trip
from tests.paths import ROOT


def trips() -> list[tuple[str, ast.Call]]:
    """Every place in the package that makes one."""
    result = []
    for path in sorted((ROOT / heli3dof.__name__).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Trip":
                result.append((f"{path.name}:{node.lineno}", node))
    return [(where, call) for where, call in result if not where.startswith("trip.py")]


def test_every_trip_has_a_cause_and_a_fix() -> None:
    assert len(trips()) > 10
    assert [where for where, call in trips() if len(call.args) != 3] == []


def test_at_most_two_trips_share_a_cause() -> None:
    causes = Counter(ast.dump(call.args[1]) for _, call in trips())
    assert max(causes.values()) <= 2


def test_a_trip_is_a_string() -> None:
    assert Trip("the rig is upside down", "someone turned it.", "turn it back") == (
        "the rig is upside down"
    )


def test_several_trips_are_joined_with_the_first_known_cause() -> None:
    seen = Trip.first("it is dark", None, Trip("it is cold", "winter.", "wait"), Trip("?", "x"))
    assert seen == "it is dark; it is cold; ?"
    assert seen is not None
    assert (seen.cause, seen.fix) == ("winter.", "wait")
    assert Trip.first(None, "") is None

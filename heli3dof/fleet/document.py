"""Write the JSON document of ``fleet --json``, schema ``heli3dof.fleet/1``.

::

    schema
    recordings         number of recordings, with the unused ones
    rigs[]             names of the rigs
    ordered_by_name[]  rigs whose flights are ordered by name, because start times are missing
    quantities[]       quantity, fleet (the estimate of the mean over the rigs, or null)
      rigs[]           rig, flights (their number), plan, estimate, own[] (recording, value, std)
    steps[]            rig, quantity, probability, kinds, size, interval, before, after
      dates[]          before, after, probability
    drifts[]           rig, quantity, probability, kinds, size, interval, first, last
    deviating[]        rig, quantity, probability, kinds, size, interval, flight
    differing[]        rig, quantity, difference, std, p_value
    bad_recordings[]   recording, rig, reason: the unused recordings

Numbers are in the quantity's unit; undefined numbers are null.

**Estimates** have the keys ``value``, ``std`` (standard error), ``interval`` (95 % limits),
``scatter`` and ``flights``. The ``estimate`` of a rig is the mean over its flights: ``scatter`` is
the standard deviation between flights, ``flights`` their number. The estimate ``fleet`` is the mean
over the rigs: ``scatter`` is the standard deviation between rigs, ``flights`` the number of rigs.
A rig's ``estimate`` uses only flights of the flight plan ``plan`` (null: recordings without a
plan). It leaves out deviating flights and all flights before the quantity's last step. ``own`` has
the shrinkage estimate of each flight used.

**Changes** are in the lists ``steps``, ``drifts`` and ``deviating`` (one flight deviates).
``probability`` is the posterior probability that the quantity changed at all in the flights
searched. ``kinds`` divides it among the kinds of change: {kind: probability}. ``interval`` has the
95 % limits of ``size``. A step lies between the flights ``before`` and ``after``; ``dates`` lists
its possible positions. A drift goes from the flight ``first`` to ``last``. Each flight has the keys
``recording`` and ``day`` (days since 1970-01-01 UTC; null if the flights are ordered by name).

**Differing rigs**: ``difference`` is the rig's value minus the mean of the other rigs. ``std`` is
the standard deviation of ``difference`` under the hypothesis that this rig is like the others. If
all rigs are alike, the probability that any rig shows such a difference in any quantity is at most
``p_value`` (Bonferroni).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from heli3dof.fleet.random_effects import shrunken
from heli3dof.json_values import jsonable

if TYPE_CHECKING:
    from heli3dof.fleet.change_search import Change
    from heli3dof.fleet.random_effects import Estimate
    from heli3dof.fleet.result import Fleet, FleetQuantity, RigQuantity
    from heli3dof.fleet.tracks import Track

SCHEMA = "heli3dof.fleet/1"


def fleet_document(fleet: Fleet) -> dict[str, Any]:
    """Return the fleet as a dict of JSON types, with the keys of the module's docstring."""
    changes = {
        kind: [_change(track, c) for track, c in fleet.changes() if c.kind == kind]
        for kind in ("step", "drift", "deviating")
    }
    document: dict[str, Any] = jsonable({
        "schema": SCHEMA,
        "recordings": fleet.recordings,
        "rigs": fleet.rigs,
        "ordered_by_name": fleet.undated,
        "quantities": [_quantity(q) for q in fleet.quantities],
        "steps": changes["step"],
        "drifts": changes["drift"],
        "deviating": changes["deviating"],
        "differing": [
            {"rig": d.rig, "quantity": quantity, "difference": d.size, "std": d.std,
             "p_value": d.p_value}
            for quantity, d in fleet.differences()
        ],
        "bad_recordings": [
            {"recording": b.recording, "rig": b.rig, "reason": b.reason} for b in fleet.bad
        ],
    })  # fmt: skip
    return document


def _quantity(q: FleetQuantity) -> dict[str, Any]:
    return {
        "quantity": q.name,
        "fleet": None if q.fleet is None else _estimate(q.fleet),
        "rigs": [
            {"rig": r.track.rig, "flights": len(r.track.y), "plan": r.plan or None,
             "estimate": _estimate(r.estimate), "own": _own(r)}
            for r in q.rigs
        ],
    }  # fmt: skip


def _estimate(e: Estimate) -> dict[str, Any]:
    return {
        "value": e.value,
        "std": e.std,
        "interval": e.interval,
        "scatter": e.scatter,
        "flights": e.n,
    }


def _own(r: RigQuantity) -> list[dict[str, Any]]:
    """Return the list ``own``: the shrinkage estimate from each flight that ``r.estimate`` uses.

    Each entry has the recording, value and standard deviation. The list is empty if the standard
    deviations are unknown, or if there is only one flight.
    """
    if r.track.s is None or r.estimate.n < 2:
        return []
    value, std = shrunken(r.track.y[r.present], r.track.s[r.present], r.estimate)
    return [
        {"recording": r.track.flights[i], "value": v, "std": d}
        for i, v, d in zip(r.present, value, std, strict=True)
    ]


def _change(track: Track, change: Change) -> dict[str, Any]:
    common = {
        "rig": track.rig,
        "quantity": track.quantity,
        "probability": change.probability,
        "kinds": change.kinds,
        "size": change.size,
        "interval": change.interval,
    }
    if change.kind == "drift":
        return {
            **common,
            "first": _flight(track, change.first),
            "last": _flight(track, change.last),
        }
    if change.kind == "deviating":
        return {**common, "flight": _flight(track, change.first)}
    dates = [
        {"before": _flight(track, k - 1), "after": _flight(track, k), "probability": p}
        for k, p in change.dates.items()
    ]
    ends = {"before": _flight(track, change.last), "after": _flight(track, change.first)}
    return {**common, **ends, "dates": dates}


def _flight(track: Track, i: int) -> dict[str, Any]:
    return {"recording": track.flights[i], "day": track.t[i] if track.dated else None}

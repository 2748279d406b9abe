"""Analyse a batch's results table: estimate each quantity, find changes and rigs that differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.batch.recording_columns import COLUMNS
from heli3dof.errors import RecordingError, quoted
from heli3dof.fleet.change_search import find_changes, track_prior
from heli3dof.fleet.random_effects import random_effects
from heli3dof.fleet.result import Fleet, FleetQuantity, RigQuantity
from heli3dof.fleet.siblings import differing_rigs, fleet_estimate
from heli3dof.fleet.tracks import (
    Row,
    Track,
    main_plan,
    quantities_of,
    tracks_of,
    usable_and_bad,
    with_distinct_rig_names,
)
from heli3dof.fleet.variance_prior import variance_prior


def analyse(rows: Sequence[Row]) -> Fleet:
    """Return the estimates, the changes and the differing rigs for each quantity in ``rows``.

    `heli3dof.fleet.tracks.read_rows` reads the ``rows`` from a batch's results table. Raises
    RecordingError if no row has a usable estimate.
    """
    usable, bad = usable_and_bad(with_distinct_rig_names(rows))
    names = quantities_of(usable)
    if not set(names) - set(COLUMNS):
        raise RecordingError(
            f"None of the {len(rows)} recordings has an estimate that can be used.",
            cause=f"no recording can be used; the first: {bad[0].recording}: {bad[0].reason}."
            if not usable
            else "the batch ran another verb, such as info, which states no numbers of a rig.",
            fix=f"heli3dof diagnose {quoted(bad[0].recording)}" if not usable
            else "heli3dof batch identify REC... -o FOLDER",
        )  # fmt: skip
    tracks, plan = tracks_of(usable, names), main_plan(usable)
    quantities = tuple(
        _quantity(name, [t for t in tracks if t.quantity == name], len(names), plan)
        for name in names
    )
    return Fleet(len(rows), plan, quantities, bad)


def _quantity(name: str, tracks: Sequence[Track], quantities: int, plan: str) -> FleetQuantity:
    rigs = [_rig_quantity(t, [o for o in tracks if o is not t], quantities, plan) for t in tracks]
    estimates = {r.track.rig: r.estimate for r in rigs if r.plan == plan}
    differing = {d.rig: d for d in differing_rigs(estimates, quantities)}
    return FleetQuantity(
        name,
        tuple(replace(r, difference=differing.get(r.track.rig)) for r in rigs),
        fleet_estimate({rig: e for rig, e in estimates.items() if rig not in differing}),
    )


def _rig_quantity(
    track: Track, siblings: Sequence[Track], quantities: int, plan: str
) -> RigQuantity:
    """Return the changes of one quantity of one rig over time, and the quantity's present estimate.

    ``track``: the quantity's values in the flights of this rig. ``siblings``: those of the other
    rigs. ``quantities``: number of quantities, by which the prior probability of a change is
    divided. ``plan``: name of the preferred flight plan.

    The estimate leaves out all flights before the quantity's last step (sudden change), and all
    deviating flights (single outliers). Of the remaining flights, it uses those with the flight
    plan ``plan``. If there are none, it uses those with the most frequent plan.
    """
    prior, of_variance = track_prior(quantities), variance_prior(siblings)
    changes = find_changes(track.t, track.y, track.s, prior, track.plans, of_variance, track.hidden)
    start = max((c.first for c in changes if c.kind == "step"), default=0)
    deviating = [c.first for c in changes if c.kind == "deviating"]
    since = np.setdiff1d(np.arange(start, len(track.y)), deviating)
    plans, counts = np.unique(track.plans[since], return_counts=True)
    own = plan if plan in plans else str(plans[counts.argmax()])
    present = since[track.plans[since] == own]
    s = np.zeros_like(track.y) if track.s is None else track.s
    estimate = random_effects(track.y[present], s[present], track.hidden[present])
    return RigQuantity(track, changes, own, present, estimate, None)

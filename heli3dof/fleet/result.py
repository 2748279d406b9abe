"""The result classes of `heli3dof.fleet.analyse`.

`Fleet` is the whole result. It contains one `FleetQuantity` for each quantity. Each `FleetQuantity`
contains one `RigQuantity` for each rig.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.fleet.change_search import NORMAL_95, Change
from heli3dof.fleet.document import fleet_document
from heli3dof.fleet.random_effects import Estimate
from heli3dof.fleet.siblings import Difference
from heli3dof.fleet.tracks import BadRecording, Track
from heli3dof.results import Result, optional

if TYPE_CHECKING:
    import pandas


THRUST_GAIN = "thrust_gain_ratio"
"""The quantity to which torques and inertias are relative (`heli3dof.batch.thrust_columns`)"""


@dataclass(frozen=True, eq=False)
class ChangeGroup:
    """A change of one quantity of one rig, and the changes of other estimates that it caused.

    Only a change of the thrust gain changes other estimates: a flight determines torques and
    inertias only relative to the thrust gain.
    """

    track: Track
    """Values of the changed quantity in the flights of the rig"""
    change: Change
    moved: tuple[str, ...] = ()
    """Names of the other quantities whose estimates changed because of ``change``"""


@dataclass(frozen=True, eq=False)
class RigQuantity:
    """One quantity of one rig: values, changes, estimate, and difference from the other rigs."""

    track: Track
    changes: tuple[Change, ...]
    plan: str
    """Plan of the flights ``present``; empty if the recordings state none"""
    present: np.ndarray
    """Indices in ``track`` of the flights of ``plan`` since the last step, except deviating ones"""
    estimate: Estimate
    """Estimate from the flights ``present``"""
    difference: Difference | None
    """Difference from the other rigs; None if it is not significant"""

    def has(self, kind: str) -> bool:
        """Return True if the quantity has a change of this ``kind``, such as "step"."""
        return any(c.kind == kind for c in self.changes)


@dataclass(frozen=True, eq=False)
class FleetQuantity:
    """One quantity: the results of each rig that has this quantity, and the mean of the rigs."""

    name: str
    rigs: tuple[RigQuantity, ...]
    fleet: Estimate | None
    """Mean of the rigs that do not differ, and the scatter between these rigs.

    None if no rig has a standard error.
    """


@dataclass(frozen=True, eq=False, repr=False)
class Fleet(Result):
    """The result of `heli3dof.fleet.analyse`: results for each quantity, and unused recordings."""

    recordings: int
    plan: str
    """Most frequent plan of the usable recordings; empty if more of them state none"""
    quantities: tuple[FleetQuantity, ...]
    bad: tuple[BadRecording, ...]

    @property
    def rigs(self) -> tuple[str, ...]:
        """Return the names of the rigs with a usable recording, sorted."""
        return tuple(sorted({r.track.rig for r in self.tracks()}))

    @property
    def undated(self) -> tuple[str, ...]:
        """Return the rigs whose flights are ordered by name, because start times are missing."""
        return tuple(sorted({r.track.rig for r in self.tracks() if not r.track.dated}))

    def tracks(self) -> Iterator[RigQuantity]:
        """Yield a `RigQuantity` for each pair of a quantity and a rig that has it."""
        for quantity in self.quantities:
            yield from quantity.rigs

    def changes(self) -> list[tuple[Track, Change]]:
        """Return a pair (track, change) for each change that the analysis found.

        A change is a step, a drift or a deviating flight in one quantity of one rig. The track
        contains this quantity's values in all flights of the rig. Steps come first, then drifts,
        then deviating flights. Within each kind, the most probable change comes first.
        """
        found = [(r.track, c) for r in self.tracks() for c in r.changes]
        kinds = ("step", "drift", "deviating")
        return sorted(found, key=lambda tc: (kinds.index(tc[1].kind), -tc[1].probability))

    def change_groups(self) -> list[ChangeGroup]:
        """Return the changes in groups, in the order of `changes`.

        A flight determines torques and inertias only relative to the thrust gain. If the gain
        changes by a factor c, their estimates change by 1/c. So a change of the gain is grouped
        with the changes of the same rig, kind and flight whose factor is 1/c within the 95 %
        intervals.
        """
        found = self.changes()
        gains = [tc for tc in found if tc[0].quantity == THRUST_GAIN]
        moved = {id(c): gain for t, c in found if (gain := _gain_of(t, c, gains)) is not None}
        in_order = [q.name for q in self.quantities]
        return [
            ChangeGroup(t, c, tuple(sorted(
                (o.quantity for o, x in found if moved.get(id(x)) is c), key=in_order.index
            )))
            for t, c in found
            if id(c) not in moved
        ]  # fmt: skip

    def differences(self) -> list[tuple[str, Difference]]:
        """Return all significant differences of a rig from the other rigs, smallest p-value first.

        Each is a pair: a quantity's name, and the `Difference` of one rig in this quantity.
        """
        found = [(r.track.quantity, r.difference) for r in self.tracks() if r.difference]
        return sorted(found, key=lambda qd: qd[1].p_value)

    def summary(self) -> str:
        """Return a summary of the result in three lines of text.

        - Line 1: the numbers of rigs, of recordings and of recordings that were not used
        - Line 2: the numbers of steps, drifts and deviating flights in the rigs' quantities
        - Line 3: the names of the rigs that differ from the other rigs
        """
        count = {k: sum(c.kind == k for _, c in self.changes()) for k in ("step", "drift")}
        return (
            f"Fleet of {len(self.rigs)} rigs, {self.recordings} recordings, "
            f"{len(self.bad)} of them not used\n"
            f"  steps: {count['step']}, drifts: {count['drift']}, "
            f"deviating flights: {len(self.changes()) - sum(count.values())}\n"
            f"  rigs that differ from their siblings: "
            f"{', '.join(sorted({d.rig for _, d in self.differences()})) or 'none'}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document that ``heli3dof fleet --json`` prints."""
        return fleet_document(self)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas data frame with a row per rig and quantity.

        Columns: the estimate's ``value``, its 95 % limits ``low`` and ``high``, the ``scatter``
        between flights, and the number of ``flights``. Raises UsageError if pandas is missing.
        """
        rows = []
        for r in self.tracks():
            low, high = r.estimate.interval
            rows.append({
                "rig": r.track.rig, "quantity": r.track.quantity, "value": r.estimate.value,
                "low": low, "high": high, "scatter": r.estimate.scatter, "flights": r.estimate.n,
            })  # fmt: skip
        return optional("pandas").DataFrame(rows).set_index(["rig", "quantity"])


def _gain_of(track: Track, change: Change, gains: list[tuple[Track, Change]]) -> Change | None:
    """Return the change of a thrust gain that caused ``change`` of another quantity, or None.

    ``track`` contains the values of this other quantity. ``gains`` contains the changes of all
    rigs' thrust gains, each with the values of the gain. If a rig's gain changes by a factor c, the
    estimates of its torques and inertias change by 1/c. So both changes must have the same rig,
    kind and flight. The product of their two factors must be 1 within its 95 % interval.
    """
    x, std = _log_factor(track, change)
    for other, gain in gains:
        y, its_std = _log_factor(other, gain)
        same = (track.rig, change.kind, change.first) == (other.rig, gain.kind, gain.first)
        if gain is not change and same and abs(x + y) <= NORMAL_95 * hypot(std, its_std):
            return gain
    return None


def _log_factor(track: Track, change: Change) -> tuple[float, float]:
    """Return ln(value after/value before) and its std; NaN if the value changes its sign."""
    before = track.y[: change.first]
    if change.kind == "deviating":
        before = np.delete(track.y, change.first)
    level = float(np.median(before)) if len(before) else float(track.y[0])
    ratio = 1 + change.size / level if level else 0.0
    if ratio <= 0:
        return np.nan, np.nan
    half = 0.5 * (change.interval[1] - change.interval[0])
    return float(np.log(ratio)), half / NORMAL_95 / abs(level) / ratio

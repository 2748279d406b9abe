"""`Outcome`: how a flight ended, and how punctual its loop was."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any, Literal

from heli3dof.rig.clock import LATE_S
from heli3dof.rig.histogram import Histogram
from heli3dof.rig.link_counters import present_names
from heli3dof.rig.trip import Trip

if TYPE_CHECKING:
    from heli3dof.experiment.control_loop.echo_latency import EchoLatency
    from heli3dof.experiment.control_loop.realtime_priority import Realtime
    from heli3dof.experiment.control_loop.timekeeping import VirtualDeadlines

Ending = Literal["completed", "tripped", "interrupted", "device", "error"]


@dataclass(frozen=True)
class Punctuality:
    """Quantiles in s of the samples' lateness and of the computing time, over one flight.

    Lateness: time from a sample's deadline to its arrival. Computing time: from a sample's arrival
    to sending the command computed from it.
    """

    median_s: float
    p99_s: float
    p999_s: float
    worst_s: float
    late_share: float
    """Share of the flown and missed periods that were missed, or late by more than `LATE_S`"""
    turnaround_median_s: float
    """s from a sample's arrival to sending the command computed from it"""
    turnaround_p999_s: float
    turnaround_worst_s: float


@dataclass(frozen=True)
class Outcome:
    """How a flight ended: reason, late and skipped periods, and the link's error counters."""

    ending: Ending
    detail: str
    """What ended the flight, in words; a `Trip` if the likely cause is known"""
    periods: int
    """Control periods flown in closed loop; the counts below also include the ramp to zero"""
    late: int
    """Periods whose sample came later than `LATE_S` after its deadline"""
    missed: int
    """Periods skipped because a sample came or was read too late"""
    worst_lateness_s: float
    landed: bool
    """True if the commands that take the motors to zero were carried out"""
    error: BaseException | None = field(default=None, compare=False)
    lost: int = 0
    """Periods skipped because their samples were lost on the line"""
    punctuality: Punctuality | None = None
    """None on a virtual clock, or if no period was flown"""
    realtime: Realtime | None = None
    """Which real-time settings the system granted; None on a virtual clock"""
    link: dict[str, Any] | None = None
    """Counters of the link to the rig (`link_counts`); None for a rig without counters"""
    device_skipped: int = 0
    """Periods skipped because the device was busy and made no sample"""
    latency: EchoLatency | None = None
    """Command-to-echo latency; None if no command was sent to an enabled device"""
    device_cause: str | None = None
    """The cause that the device states for holding its output at zero, or None"""
    ramped: bool = False
    """True if the motors were ramped to zero; False if they were set to zero volts at once"""

    def advice(self) -> dict[str, str]:
        """Return ``likely_cause`` and ``fix`` of the flight's end; an empty dict if unknown."""
        if not isinstance(self.detail, Trip):
            return {}
        return {"likely_cause": self.detail.cause, "fix": self.detail.fix}

    def details(self) -> dict[str, Any]:
        """Return the outcome as a dict for the recording's file; its keys contain the units."""
        return {
            "detail": self.detail,
            **self.advice(),
            "device_cause": self.device_cause,
            "periods": self.periods,
            "late": self.late,
            "missed": self.missed,
            "lost": self.lost,
            "device_skipped": self.device_skipped,
            "worst_lateness_s": self.worst_lateness_s,
            "landed": self.landed,
            "ramped": self.ramped,
            "punctuality": asdict(self.punctuality) if self.punctuality else None,
            "realtime": self.realtime.to_dict() if self.realtime else None,
            "link": self.link,
            "latency": asdict(self.latency) if self.latency else None,
        }


def link_counts(rig: Any) -> dict[str, Any] | None:
    """Return the link's counters ``rig.statistics`` as a dict for JSON; None if the rig has none.

    A histogram of times is replaced by its median, 99.9 % quantile and largest time.
    """
    statistics = getattr(rig, "statistics", None)
    if not is_dataclass(statistics) or isinstance(statistics, type):
        return None
    kept: dict[str, Any] = {}
    for name in (f.name for f in fields(statistics)):
        value = getattr(statistics, name)
        if isinstance(value, int | float):
            kept[name] = value
        elif hasattr(value, "quantile_s") and value.n:
            kept[f"{name}_median_s"] = value.quantile_s(0.5)
            kept[f"{name}_p999_s"] = value.quantile_s(0.999)
            kept[f"{name}_worst_s"] = value.worst_s
    return present_names(kept)


class Tally:
    """Counts late and skipped periods of a flight; collects lateness and computing times."""

    def __init__(self) -> None:
        self.late = self.missed = self.lost = self.device_skipped = 0
        self.lateness = Histogram()
        self.turnaround = Histogram()

    @property
    def worst(self) -> float:
        """Return the largest delay of a sample after its deadline, in s."""
        return self.lateness.worst_s

    def count(self, deadlines: VirtualDeadlines, computing_s: float) -> None:
        """Add one control period to the counts.

        ``deadlines``: contains the lateness of the period's last sample, and how many periods were
        skipped before this sample. ``computing_s``: s from a sample's arrival to sending the
        command that was computed from this sample.
        """
        if deadlines.lateness > LATE_S:
            self.late += 1
        self.missed += deadlines.missed
        self.lost += deadlines.lost
        self.device_skipped += deadlines.device_skipped
        self.lateness.add(deadlines.lateness)
        self.turnaround.add(computing_s)

    def punctuality(self) -> Punctuality | None:
        """Return quantiles of lateness and computing time in s; None if no period was counted."""
        late, turn = self.lateness, self.turnaround
        n = late.n
        if not n:
            return None
        return Punctuality(
            late.quantile_s(0.5),
            late.quantile_s(0.99),
            late.quantile_s(0.999),
            late.worst_s,
            (self.late + self.missed) / (n + self.missed),
            turn.quantile_s(0.5),
            turn.quantile_s(0.999),
            turn.worst_s,
        )

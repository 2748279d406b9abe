"""What a monitor shows of a rig: its last reading, rates from two of them, ranges, flags seen.

rate = (angle[k] − angle[k−1]) / (t[k] − t[k−1]),  t on the device's clock
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from heli3dof.axes import AXES, MOTORS

if TYPE_CHECKING:
    from rich.table import Table


class View:
    """Takes readings (`heli3dof.rig.session.open_exclusive.reading`); any key may be missing."""

    def __init__(self) -> None:
        self.readings = 0
        self.last: dict[str, Any] = {}
        self.rate_deg_per_s: dict[str, float | None] = dict.fromkeys(AXES)
        self.low_deg: dict[str, float] = {}
        self.high_deg: dict[str, float] = {}
        self.flags_seen: set[str] = set()
        self.worst_lateness_s = 0.0

    def add(self, reading: dict[str, Any]) -> None:
        """Take the next reading."""
        before, self.last = self.last, reading
        self.readings += 1
        self.flags_seen.update(reading.get("flags", ()))
        self.worst_lateness_s = max(self.worst_lateness_s, reading.get("lateness_s", 0.0))
        if "device_time_s" not in reading:
            return
        passed = reading["device_time_s"] - before.get("device_time_s", float("nan"))
        for axis in AXES:
            key = f"{axis}_deg"
            angle = reading[key]
            if passed > 0:
                self.rate_deg_per_s[axis] = (angle - before[key]) / passed
            self.low_deg[axis] = min(angle, self.low_deg.get(axis, angle))
            self.high_deg[axis] = max(angle, self.high_deg.get(axis, angle))

    def line(self) -> str:
        """One line: for logs, and terminals without a live display."""
        last = self.last
        if "roll_deg" not in last:
            return "no answer"
        words = [f"{axis} {last[f'{axis}_deg']:+7.2f}°" for axis in AXES]
        words += [f"{motor} {last[f'v_{motor}_V']:+6.2f} V" for motor in MOTORS]
        return "  ".join([*words, *self._said()])

    def table(self) -> Table:
        """The live display."""
        from rich.table import Table

        last = self.last
        table = Table("", "now", "per s", "lowest", "highest", caption=self._caption())
        for column in table.columns[1:]:
            column.justify = "right"
        for axis in AXES:
            if f"{axis}_deg" in last:
                rate = self.rate_deg_per_s[axis]
                table.add_row(
                    axis,
                    f"{last[f'{axis}_deg']:+.2f}°",
                    "" if rate is None else f"{rate:+.1f}°",
                    f"{self.low_deg[axis]:+.2f}°",
                    f"{self.high_deg[axis]:+.2f}°",
                )
        for motor in MOTORS:
            if f"v_{motor}_V" in last:
                current = last.get(f"i_{motor}_A")
                drawn = "" if current is None else f", {current:+.2f} A"
                table.add_row(motor, f"{last[f'v_{motor}_V']:+.2f} V{drawn}")
        return table

    def _caption(self) -> str:
        return " · ".join(self._said()) if "flags" in self.last else "no answer"

    def _said(self) -> list[str]:
        """Flags, and how punctual: the flight's lateness, or how soon a free rig answered."""
        last = self.last
        words = [" ".join(last["flags"]) or "not enabled"]
        if "lateness_s" in last:
            words.append(f"late {last['lateness_s'] * 1e3:.2f} ms")
        if "answer_s" in last:
            words.append(f"answered in {last['answer_s'] * 1e3:.2f} ms")
        if "phase" in last:
            words.append(f"{last['phase']}, {last['late']} periods late")
        return words

    def document(self) -> dict[str, Any]:
        """What was seen, for scripts."""
        return {
            "readings": self.readings,
            "last": self.last or None,
            "rate_deg_per_s": self.rate_deg_per_s,
            "lowest_deg": self.low_deg,
            "highest_deg": self.high_deg,
            "flags_seen": sorted(self.flags_seen),
            "worst_lateness_s": self.worst_lateness_s,
        }

"""`MonitorState`: what ``heli3dof monitor`` shows, computed from a rig's readings.

rate = (angle[k] − angle[k−1]) / (t[k] − t[k−1]),  t of reading k on the device's clock
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from heli3dof.axes import AXES, MOTORS
from heli3dof.cli.output_encoding import printable
from heli3dof.cli.traces import Traces, fits
from heli3dof.errors import minus

if TYPE_CHECKING:
    from rich.console import Console, RenderableType


class MonitorState:
    """Collects a rig's readings.

    Keeps the last reading and the present rates (°/s). For all readings together, keeps the range
    of each angle (°), every flag that was set, and the largest lateness (s).
    """

    def __init__(self) -> None:
        self.readings = 0
        self.last: dict[str, Any] = {}
        self.rate_deg_per_s: dict[str, float | None] = dict.fromkeys(AXES)
        self.low_deg: dict[str, float] = {}
        self.high_deg: dict[str, float] = {}
        self.flags_seen: set[str] = set()
        self.worst_lateness_s = 0.0
        self.traces = Traces()

    def add(self, reading: dict[str, Any]) -> None:
        previous, self.last = self.last, reading
        self.readings += 1
        self.flags_seen.update(reading.get("flags", ()))
        self.worst_lateness_s = max(self.worst_lateness_s, reading.get("lateness_s", 0.0))
        if "device_time_s" not in reading:
            return
        elapsed_s = reading["device_time_s"] - previous.get("device_time_s", float("nan"))
        self.traces.add(reading["device_time_s"], [reading[f"{axis}_deg"] for axis in AXES])
        for axis in AXES:
            key = f"{axis}_deg"
            angle = reading[key]
            if elapsed_s > 0:
                self.rate_deg_per_s[axis] = (angle - previous[key]) / elapsed_s
            self.low_deg[axis] = min(angle, self.low_deg.get(axis, angle))
            self.high_deg[axis] = max(angle, self.high_deg.get(axis, angle))

    def line(self) -> str:
        """Return the last angles (°), voltages (V), flags and delays (ms) as one line of text."""
        last = self.last
        if "roll_deg" not in last:
            return "no answer"
        words = [f"{axis} {last[f'{axis}_deg']:+7.2f}°" for axis in AXES]
        return minus("  ".join([*words, *self._voltages(), *self._status()]))

    def screen(self, console: Console) -> RenderableType:
        """Return what a terminal shows: traces of the angles, or one line if they do not fit."""
        from rich.console import Group
        from rich.text import Text

        if "roll_deg" not in self.last or not fits(console):
            return Text(printable(self.line(), console.encoding), no_wrap=True, overflow="ellipsis")
        return Group(
            *self.traces.draw(self._heads(), console.width),
            Text(minus("   ".join(self._voltages()))),
            Text(" · ".join(self._status())),
            Text("Ctrl-C ends the display.", "bold"),
        )

    def _heads(self) -> list[str]:
        """Return a line for each axis: angle, rate, and the range of all angles seen."""
        heads = []
        for axis in AXES:
            rate = self.rate_deg_per_s[axis]
            heads.append(
                f"{axis:<6}{self.last[f'{axis}_deg']:+8.2f}°   "
                + ("" if rate is None else f"{rate:+7.1f} °/s   ")
                + f"seen {self.low_deg[axis]:+.2f} to {self.high_deg[axis]:+.2f}°"
            )
        return heads

    def _voltages(self) -> list[str]:
        """Return the voltage of each motor (V) and its current (A), where known."""
        texts = []
        for motor in MOTORS:
            if f"v_{motor}_V" in self.last:
                current = self.last.get(f"i_{motor}_A")
                drawn = "" if current is None else f", {current:+.2f} A"
                texts.append(f"{motor} {self.last[f'v_{motor}_V']:+6.2f} V{drawn}")
        return texts

    def _status(self) -> list[str]:
        """Return the last reading's flags, delays (ms) and flight phase as texts, where known."""
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
        """Return the state as the JSON document of ``monitor --json``."""
        return {
            "readings": self.readings,
            "last": self.last or None,
            "rate_deg_per_s": self.rate_deg_per_s,
            "lowest_deg": self.low_deg,
            "highest_deg": self.high_deg,
            "flags_seen": sorted(self.flags_seen),
            "worst_lateness_s": self.worst_lateness_s,
        }

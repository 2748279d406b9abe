"""Describe the timing of a flight's control loop as text, for ``info`` and a flight's summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from heli3dof.experiment.control_loop.outcome import Outcome


def timing_rows(about: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return table rows (label, text) on a flight's lateness, skipped periods and latency.

    ``about`` is the recording's `heli3dof.recording.info.summary`.
    """
    rows: list[tuple[str, str]] = []
    late, details = about["lateness"], about["outcome_details"]
    if late:
        rows.append(("lateness", _quantiles(late["median_s"], late["p999_s"], late["max_s"])))
        rows.append(("late by over 1 ms", f"{late['late_ticks']} of {about['samples']} periods"))
    skipped = _skipped(*(details.get(name, 0) for name in ("missed", "lost", "device_skipped")))
    if skipped:
        rows.append(("skipped", skipped))
    timing = details.get("punctuality")
    if timing:
        turnaround = (timing[f"turnaround_{q}_s"] for q in ("median", "p999", "worst"))
        rows.append(("sample to command", _quantiles(*turnaround)))
    latency = details.get("latency")
    if latency:
        if latency["median_s"] is not None:
            times = (
                f"{name} {_ms(latency[f'{key}_s'])} ({_periods(latency[f'{key}_periods'])})"
                for name, key in (("median", "median"), ("99.9 %", "p999"), ("maximum", "worst"))
            )
            rows.append(("command to echo", ", ".join(times)))
        echoes = (
            f"{latency['commands_unacknowledged']} of {latency['commands']} commands not echoed by "
            f"the next sample, {latency['commands_never_echoed']} never echoed"
        )
        rows.append(("unacknowledged", echoes))
    realtime = details.get("realtime")
    if realtime:
        scheduled, locked = (
            "yes" if realtime[name] else "no" for name in ("scheduled", "memory_locked")
        )
        rows.append(("real time", f"scheduled {scheduled}, memory locked {locked}"))
    return rows


def timing_note(outcome: Outcome, samples: int) -> str:
    """Return a text that counts a flight's late and skipped control periods.

    ``samples``: number of samples in flight and ramp. `timing_rows` has the quantiles of lateness
    and latency.
    """
    late = f"late by more than 1 ms: {outcome.late} of {samples} periods"
    skipped = _skipped(outcome.missed, outcome.lost, outcome.device_skipped)
    return f"{late}; skipped: {skipped}" if skipped else late


def realtime_advice(outcome: Outcome) -> str | None:
    """Return a text on how to obtain a real-time permission that the system refused for the flight.

    The result is None if no sample was late, or if no permission was refused.
    """
    if outcome.realtime is None or not (outcome.late or outcome.missed):
        return None
    refused = outcome.realtime.refused
    if not refused:
        return None
    names = " and ".join(check.what for check in refused)
    return f"Some periods were late, and {names} was not granted. Try: {refused[0].fix}"


def _skipped(missed: int, lost: int, device_skipped: int) -> str:
    return ", ".join(
        text
        for count, text in (
            (missed, f"{missed} (sample late)"),
            (lost, f"{lost} (sample lost on the line)"),
            (device_skipped, f"{device_skipped} (no sample taken by the device)"),
        )
        if count
    )


def _quantiles(median_s: float, p999_s: float, worst_s: float) -> str:
    return f"median {_ms(median_s)}, 99.9 % {_ms(p999_s)}, maximum {_ms(worst_s)}"


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.2f} ms" if seconds >= 1e-4 else f"{seconds * 1e6:.0f} µs"


def _periods(count: int) -> str:
    return "1 period" if count == 1 else f"{count} periods"

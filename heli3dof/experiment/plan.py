"""Plans: read from TOML, summarised, and checked against the profile's limits before a flight.

    name = "roll-step"
    [[segment]]
    kind = "step"
    roll_deg = 10
    duration_s = 20

Rendering turns a plan into one row of references and extra voltages per control period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from heli3dof.arrays import FloatArray
from heli3dof.axes import AXES
from heli3dof.errors import PlanError, UsageError, did_you_mean
from heli3dof.experiment.segments import BaseSegment, Clock, kinds
from heli3dof.rig.profile import Profile
from heli3dof.toml_file import Key, Section, check, read_toml

MIN_COUNTS = 2.0
"""Encoder counts; a smaller motion of the reference may come from an angle in radians. Chosen."""


@dataclass(frozen=True, eq=False)
class Signals:
    """A plan's signals: angle references and added voltages for each control period."""

    t: FloatArray
    """(N,) s"""
    reference: FloatArray
    """(N, 3) rad, before the controller's rate limiter."""
    extra: FloatArray
    """(N, 2) V, added to the controller's output."""
    opened: FloatArray | None = None
    """(N, 3) mode of each axis's loop (`model.control.controller`); None: all closed"""
    drawn: bool = False
    """True if the signals depend on the seed"""

    def warnings(self, profile: Profile) -> list[str]:
        """Return a warning for each axis whose reference moves by less than `MIN_COUNTS`."""
        moves, counts = np.abs(self.reference).max(axis=0), np.abs(profile.encoder.rad_per_count)
        return [
            f"{axis}'s reference moves by {np.degrees(move):.2g}° only, {move / count:.1f} "
            f"encoder counts. Angles are in degrees: {np.degrees(move):.2g} rad would be "
            f"{np.degrees(np.degrees(move)):.2g}°."
            for axis, move, count in zip(AXES, moves, counts, strict=True)
            if 0 < move < MIN_COUNTS * count
        ]


class Head(Section):
    """The top level of a plan's TOML file: name, description, purpose and segments."""

    name: Annotated[str, Key("the plan's name, shown in tables and recordings")]
    description: Annotated[str, Key("what it flies, in one line")] = ""
    purpose: Annotated[str, Key("what it is good for, in one line")] = ""
    segment: Annotated[
        list[dict[str, Any]], Key("the segments, in the order flown; each a table `[[segment]]`")
    ] = Field(min_length=1)


@dataclass(frozen=True)
class Plan:
    """An experiment as a named sequence of segments, such as a step or a chirp."""

    name: str
    segments: tuple[BaseSegment, ...]
    description: str = ""
    purpose: str = ""

    @property
    def duration_s(self) -> float:
        return sum(s.duration_s for s in self.segments)

    def render(self, dt: float, seed: int) -> Signals:
        """Return the plan's signals for control periods of ``dt`` seconds.

        ``seed``: seed of the random signals. Raises PlanError, naming the segment, if a
        value in a segment is too large or too small to compute its signal, or if the signal has
        another shape or is not finite.
        """
        rng = np.random.default_rng(seed)
        initial = rng.bit_generator.state
        before = np.zeros(3)
        references, extras, opened = [], [], []
        for k, segment in enumerate(self.segments, 1):
            try:
                clock = Clock(max(1, round(segment.duration_s / dt)), dt, rng)
                reference, extra = segment.render(clock, before)
                mode = segment.opened(clock)
                for what, signal, columns in (
                    ("references", reference, 3), ("voltages", extra, 2), ("loop modes", mode, 3)
                ):  # fmt: skip
                    if np.shape(signal) != (clock.n, columns) or not np.isfinite(signal).all():
                        raise ValueError(f"its {what} are not {clock.n} × {columns} finite numbers")
            except (ArithmeticError, IndexError, TypeError, ValueError, MemoryError) as problem:
                raise PlanError(
                    f"Segment {k} of the plan {self.name!r} ({segment.kind}) has no signal: "
                    f"{problem}.",
                    cause="a number in it is far too small or too large, or a mistake in its kind.",
                    fix=f"correct segment {k}; docs/reference/plans.md lists each key and its unit",
                ) from problem
            references.append(reference)
            extras.append(extra)
            opened.append(mode)
            before = reference[-1]
        reference = np.concatenate(references)
        modes = np.concatenate(opened)
        return Signals(
            dt * np.arange(len(reference), dtype=float),
            reference,
            np.concatenate(extras),
            modes if modes.any() else None,
            drawn=rng.bit_generator.state != initial,
        )

    def summary(self) -> list[str]:
        return [s.summary() for s in self.segments]

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as a nested dict with the keys of its TOML file, for the recording."""
        segments = [s.model_dump(mode="json", exclude_none=True) for s in self.segments]
        head = {"name": self.name, "description": self.description, "purpose": self.purpose}
        return {**{k: v for k, v in head.items() if v or k != "purpose"}, "segment": segments}


def checked(plan: Plan, profile: Profile, seed: int) -> Signals:
    """Return the signals of `Plan.render` after checking them against the profile's limits.

    Raises PlanError if duration, references or added voltages exceed the limits.
    """
    limits = profile.limits
    if plan.duration_s > limits.duration_max_s:  # before rendering, which needs memory
        raise PlanError(
            f"The plan {plan.name!r} lasts {plan.duration_s:g} s; the profile allows "
            f"{limits.duration_max_s:g} s.",
            cause="a duration in milliseconds, or a long plan on a cautious profile.",
            fix="shorten it, or raise limits.duration_max_s in the profile",
        )
    signals = plan.render(profile.dt, seed)
    for i, (axis, (low, high)) in enumerate(zip(AXES, limits.ranges_deg, strict=True)):
        reference = np.degrees(signals.reference[:, i])
        worst = reference[np.argmax(np.abs(reference))]
        if reference.min() < low or reference.max() > high:
            raise PlanError(
                f"The plan {plan.name!r} commands {axis} "
                + f"{worst:g}°; the profile allows {low:g}° to {high:g}°.".replace("-", "−"),
                cause="a typing error, or a plan for another rig.",
                fix=f"lower the angle in the plan, or widen the {axis} limits of the profile",
            )
    extra = float(np.abs(signals.extra).max())
    if extra > profile.motor.v_max:
        raise PlanError(
            f"The plan {plan.name!r} adds up to {extra:.3g} V to the motors; the amplifier "
            f"gives {profile.motor.v_max:g} V.",
            cause="an amplitude that belongs to another amplifier.",
            fix="lower the amplitudes of the plan",
        )
    return signals


def plan_from_dict(data: Mapping[str, Any], *, source: str = "plan") -> Plan:
    """Return the plan described by ``data``, nested dicts as read from a TOML file.

    ``source`` is the plan's name in the message of a PlanError.
    """
    head = check(Head, data, source, PlanError)
    segments = [_segment(s, i, source) for i, s in enumerate(head.segment, start=1)]
    return Plan(head.name, tuple(segments), head.description, head.purpose)


def _segment(data: Mapping[str, Any], number: int, source: str) -> BaseSegment:
    where = f"{source}, segment {number}"
    kind = data.get("kind")
    if not isinstance(kind, str) or kind not in kinds():
        raise PlanError(
            f"{where}: there is no segment of kind {kind!r}."
            if kind is not None
            else f"{where}: the key 'kind' is missing.",
            cause=f"a typing error; {did_you_mean(str(kind), kinds())}",
            fix=f"kinds: {', '.join(sorted(kinds()))}",
        )
    return check(kinds()[kind], data, where, PlanError)


def named_plans() -> dict[str, Path]:
    """Return the plans that come with heli3dof: the path of each TOML file by the plan's name."""
    folder = Path(str(resources.files("heli3dof.experiment") / "plans"))
    return {p.stem: p for p in sorted(folder.glob("*.toml"))}


def load_plan(name_or_path: str | Path) -> Plan:
    """Return the plan with this name that comes with heli3dof, or the plan in this TOML file.

    Raises PlanError for an unknown name or a faulty file.
    """
    known = named_plans()
    path = known.get(str(name_or_path), Path(name_or_path))
    return plan_from_dict(read_toml(path, "plan", PlanError, known), source=str(path))


def step_plan(
    target_deg: Sequence[float | None] = (None, None, None),
    *,
    roll: float | None = None,
    pitch: float | None = None,
    yaw: float | None = None,
    settle_s: float = 10.0,
    duration_s: float = 20.0,
) -> Plan:
    """Make a plan: hold level for ``settle_s`` (0: no hold), then step to these angles in degrees.

    ``duration_s``: duration of the step in s. ``step_plan(roll=10)`` and ``step_plan((10, None,
    None))`` are the same plan. The reference of an axis without an angle stays 0. Raises UsageError
    for an axis with two angles, PlanError for a wrong time or angle.
    """
    given: dict[str, float] = {}
    for axis, first, second in zip(AXES, target_deg, (roll, pitch, yaw), strict=True):
        if first is not None and second is not None:
            raise UsageError(
                f"step_plan got two angles for {axis}: {first:g}° and {second:g}°.",
                cause="the axis is in target_deg and also named.",
                fix=f"one of them: step_plan({axis}={second:g})",
            )
        value = second if first is None else first
        if value is not None:
            given[f"{axis}_deg"] = float(value)
    segments: list[dict[str, Any]] = []
    if settle_s != 0:
        segments.append({"kind": "hold", "duration_s": float(settle_s)})
    segments.append({"kind": "step", "duration_s": float(duration_s), **given})
    name = "-".join(["step", *(f"{k.removesuffix('_deg')}-{v:g}" for k, v in given.items())])
    return plan_from_dict({"name": name, "segment": segments}, source="the step plan")

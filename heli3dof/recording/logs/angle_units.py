"""Check that a log's angles have the unit that their column's name states, by three tests.

1. The encoder's grid: angles are multiples of 360/N degrees or 2π/N radians for N counts per
   revolution. Values on the grid of one unit are not on the other grid.
2. Size: roll and pitch stay within ±180°. If a column's name states radians, its angle must also
   stay within the profile's ``limits.yaw_max_deg``. Degrees that are taken for radians appear 57.3
   times as large and usually exceed this limit.
3. Newton's law, for roll and pitch: over windows of length T, the second difference of an angle q
   is the torque M over the inertia J, integrated twice:

       q(t+T) − 2 q(t) + q(t−T) = ∫ w(τ) M(t+τ)/J dτ,   w a triangle of height T and width 2T

   M/J follows from the front and back voltage: L_a K_f (V_f + V_b)/J_roll on roll,
   L_h K_f (V_f − V_b)/J_pitch on pitch. L_a and L_h are lever arms, K_f is the thrust per volt. The
   test divides the standard deviation of the left side by that of the right side. This ratio is
   0.4 … 2.7 on real rigs, because M lacks other torques. A wrong unit changes it by a factor of
   57.3.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError, minus
from heli3dof.recording.logs.known_names import as_options, operand
from heli3dof.rig.profile import Profile

TURN = {"deg": 360.0, "rad": 2 * np.pi}
OTHER = {"deg": "rad", "rad": "deg"}
FULL_NAME = {"deg": "degrees", "rad": "radians"}
OFF_GRID = 0.2
"""A value is on the grid if its distance to the grid is below this share of the step. At least 90 %
of an encoder's values are on its grid, even if printed with six digits; of other values, 40 %."""
COMMON_COUNTS = (500, 512, 1000, 1024, 2000, 2048, 2500, 4000, 4096, 5000, 8000, 8192, 10000,
                 16384, 20000)  # fmt: skip
OR_EXCHANGED = "; or two columns are swapped, which heli3dof diagnose finds."
NEWTON_WINDOW_S = 0.25
NEWTON_FACTOR = float(np.sqrt(180 / np.pi))
"""Limit of `newton`'s ratio: the geometric mean of 1 (right unit) and 57.3 (wrong unit)"""

WRAP = 0.05
"""Largest difference of a jump from a whole turn, as a share of it: the axis moves meanwhile.
Chosen; 18° within a sample exceed the speed of every rig."""
COUNTS_FACTOR = 4.0
"""`newton`'s ratio above which whole numbers stated in degrees are raw encoder counts. 4096 or 8192
counts per revolution give 11 or 23; real rigs give up to 2.7."""

AGAINST = -0.4
"""`newton`'s correlation below which the angle's sign counts as wrong. Real rigs have +0.3 … +0.8
in closed loop, −0.1 … 0 at a constant voltage."""


def on_grid(values: np.ndarray, step: float, levels: int = 2) -> bool:
    """Return True if 90 % of the distinct values lie on a grid with spacing ``step``.

    The grid starts at the first value; ``step`` has the unit of the values. The result is False for
    fewer than ``levels`` distinct values, and for values that all lie within half a step.
    """
    seen = np.unique(values)
    steps = (seen - values[0]) / step
    counts = np.rint(steps)
    near = np.abs(steps - counts) < OFF_GRID
    return len(seen) >= levels and bool(counts.any()) and float(near.mean()) >= 0.9


def check_angles(
    source: str,
    columns: Mapping[str, np.ndarray],
    profile: Profile,
    origins: Mapping[str, str] | None = None,
) -> list[str]:
    """Raise RecordingError if an angle's name states a wrong unit; return warnings.

    Warnings: an angle that is constant, moves against its voltages, is off the encoder's grid, or
    may have another unit. ``source`` is the log's name for messages. ``columns`` are those of
    docs/reference/recording.md. ``origins``: column → the expression of the log's columns from
    which it was computed (`Table.origins`).
    """
    warnings: list[str] = []
    for axis in AXES:
        for unit in ("deg", "rad"):
            name = f"{axis}_{unit}"
            if name not in columns:
                continue
            expression = operand((origins or {}).get(name, name))
            warnings += _check_angle(source, name, columns, profile, expression)
            for ref_unit in ("deg", "rad"):
                ref = f"{axis}_ref_{ref_unit}"
                if ref in columns:
                    _check_reference(source, name, columns[name] / TURN[unit],
                                     ref, columns[ref] / TURN[ref_unit])  # fmt: skip
    return warnings


def _check_angle(
    source: str, name: str, columns: Mapping[str, np.ndarray], profile: Profile, expression: str
) -> list[str]:
    values = columns[name]
    axis, unit, counts = _of_column(name, profile)
    if np.ptp(values) == 0:
        return [f"{name} never changes: the axis is clamped, or its encoder is not connected."]
    warnings = _wrap_warnings(name, values, TURN[unit], expression)
    found = newton(axis, values * (2 * np.pi / TURN[unit]), columns, profile)
    ratio = None if found is None else found[0]
    if found is not None and found[1] < AGAINST:
        other = ", or front and back are swapped or are sum and difference"
        warnings.append(
            minus(
                f"{name} moves against its voltages (correlation {found[1]:.2f}): its sign may be "
                f"wrong{other if axis == 'pitch' else ''}."
            )
        )
    if not on_grid(values, TURN[unit] / counts):
        _refuse_wrong_unit(source, name, values, ratio, profile, expression)
    seen = counts_seen(values, unit, counts)
    if seen == counts:
        return warnings
    if seen is not None:
        return [
            *warnings,
            f"{name} lies on a grid of {seen:.6g} counts per revolution, but the profile has "
            f"{counts}: check [encoder] and the angle's scale.",
        ]
    warnings.append(
        f"{name} does not lie on the encoder's grid of {360 / counts:.4f}°. Likely cause: "
        "filtering, resampling, printing with few digits, or a simulation without encoder."
    )
    largest = float(np.abs(values).max())
    if unit == "deg" and largest < 1.6 and ratio is None:
        warnings.append(f"{name} stays within ±{largest:.2g}: it may be in radians.")
    if unit == "rad" and largest > 2 * np.pi:
        warnings.append(f"{name} reaches {largest:.3g}, more than a turn: it may be in degrees.")
    return warnings


def _wrap_warnings(name: str, values: np.ndarray, turn: float, logged: str) -> list[str]:
    """Return a warning if the angles (N,) jump by a whole ``turn`` between two samples."""
    jumps = np.abs(np.abs(np.diff(values)) - turn) < WRAP * turn
    if not jumps.any():
        return []
    argument = logged if logged.startswith("(") else f"({logged})"
    times = f"{jumps.sum()} times" if jumps.sum() > 1 else "once"
    return [
        f"{name} jumps by a whole turn within one sample, {times}. Likely cause: the angle is "
        f"wrapped. Try: import the log with {as_options({name: f'unwrap{argument}'})}"
    ]


def _of_column(name: str, profile: Profile) -> tuple[str, str, int]:
    """Return axis, unit and the encoder's counts per revolution of an angle's column."""
    axis, _, unit = name.partition("_")
    return axis, unit, abs(int(getattr(profile.encoder, axis)))


def _refuse_wrong_unit(
    source: str,
    name: str,
    values: np.ndarray,
    ratio: float | None,
    profile: Profile,
    expression: str,
) -> None:
    """Raise RecordingError if angles are not in the unit that their column's name states.

    * ``source``: name of the log; ``name``: name of the angle's column
    * ``values``: angles (N,), which are not on the encoder's grid in the stated unit
    * ``ratio``: measured motion divided by the motion that the voltages explain (`newton`); None if
      unknown
    * ``expression``: how the angle was computed from the log's columns, for messages
    """
    axis, unit, counts = _of_column(name, profile)
    other = OTHER[unit]
    largest = float(np.abs(values).max())
    too_large = axis != "yaw" and largest > TURN[unit] / 2
    too_far = ratio is not None and ratio > (COUNTS_FACTOR if unit == "deg" else NEWTON_FACTOR)
    if (unit == "rad" or too_large or too_far) and on_grid(values, 1, levels=10):
        to_unit = f"{TURN[unit] / counts:.6g}"
        raise RecordingError(
            f"{source}: {name} contains whole numbers up to {largest:.6g}, which are not "
            f"{FULL_NAME[unit]}.",
            cause=f"raw encoder counts ({counts} per revolution).",
            fix=f"multiply them by {to_unit} (and by the encoder's sign): "
            + as_options({name: f"{to_unit}*{expression}"}),
        )
    if on_grid(values, TURN[other] / counts, levels=4):
        raise wrong_unit(
            source, name,
            f"its values lie on the encoder's grid in {FULL_NAME[other]} "
            f"({TURN[other] / counts:.6f} per count), not in {FULL_NAME[unit]}",
        )  # fmt: skip
    if unit == "deg" and too_large:
        raise RecordingError(
            f"{source}: {name} reaches {largest:.6g}°, more than the axis can turn.",
            cause="another unit, or roll and yaw swapped.",
            fix="convert the values to degrees, or correct the header line",
        )
    if too_large:
        raise wrong_unit(source, name, f"it reaches {largest:.6g}")
    if unit == "rad" and largest > np.radians(profile.limits.yaw_max_deg):
        raise wrong_unit(
            source, name,
            f"it reaches {largest:.6g} rad, and limits.yaw_max_deg is "
            f"{profile.limits.yaw_max_deg:g}°",
        )  # fmt: skip
    too_near = unit == "deg" and ratio is not None and ratio < 1 / NEWTON_FACTOR
    if (too_near and largest < np.pi) or (unit == "rad" and too_far):
        raise wrong_unit(
            source, name,
            f"the motion is {ratio:.2g} times what the voltages explain",
        )  # fmt: skip


def counts_seen(values: np.ndarray, unit: str, counts: int) -> float | None:
    """Return the counts per revolution of the encoder on whose grid the angles lie, or None.

    The grid of an encoder with N counts per revolution has the spacing 360°/N. ``values`` (n,):
    angles in ``unit``; ``counts``: counts per revolution in the profile.

    If the angles lie on the profile's grid, the result is ``counts``. It is ``counts``/2,
    ``counts``/3, … if the angles lie only on every second, third, … point of this grid. If they do
    not lie on the profile's grid, the result is the first number in `COMMON_COUNTS` whose grid
    fits. None: no grid fits.
    """
    if on_grid(values, TURN[unit] / counts):
        seen = np.unique(np.rint((values - values[0]) * counts / TURN[unit]).astype(np.int64))
        divisor = int(np.gcd.reduce(seen))
        return counts if len(seen) < 10 or divisor < 2 else counts / divisor
    return next((n for n in COMMON_COUNTS if on_grid(values, TURN[unit] / n, levels=10)), None)


def _check_reference(
    source: str, name: str, angle: np.ndarray, ref: str, reference: np.ndarray
) -> None:
    """Raise RecordingError if an angle follows its reference, but one of their units is wrong.

    ``name`` and ``ref`` are the names of the two columns. The caller has converted ``angle`` and
    ``reference`` (N,) to revolutions, from the units that these names state. If a stated unit is
    wrong, the slope of ``angle`` over ``reference`` is about 57.3 or 1/57.3. The function raises
    the error if the slope is outside 1/15 … 15 and the correlation exceeds 0.5.
    """
    spread = float(np.std(reference))
    if spread == 0 or np.std(angle) == 0:
        return
    covariance = float(np.mean((angle - angle.mean()) * (reference - reference.mean())))
    slope = covariance / spread**2
    follows = covariance / (spread * float(np.std(angle))) > 0.5
    if follows and not 1 / 15 < slope < 15:
        raise RecordingError(
            f"{source}: {name} follows {ref} with a slope of {slope:.3g}.",
            cause=f"one of the two is in {'radians' if name.endswith('deg') else 'degrees'}, "
            f"unlike its name (a factor of {180 / np.pi:.3g}){OR_EXCHANGED}",
            fix=f"rename {name} or {ref} to its true unit",
        )


def newton(
    axis: str, angle: np.ndarray, columns: Mapping[str, np.ndarray], profile: Profile
) -> tuple[float, float] | None:
    """Compare an angle's motion with the motion that the voltages explain by Newton's law.

    The measured motion is the angle's second difference over windows of `NEWTON_WINDOW_S`. The
    explained motion is the acceleration torque/inertia, integrated twice. The function returns two
    values:

    * the standard deviation of the measured motion divided by that of the explained motion, about 1
      if the unit is right
    * the correlation of the two, positive if the sign is right

    Returns None for yaw, for fewer than eight windows, for less than about one count of explained
    motion, and for constant measured motion. ``angle`` (N,): the angle of ``axis`` in rad;
    ``columns`` must contain times and voltages.
    """
    dt = float(np.median(np.diff(columns["t_s"])))
    n = max(1, round(NEWTON_WINDOW_S / dt))
    if axis == "yaw" or len(angle) < 8 * n:
        return None
    L, K_f, (J_roll, J_pitch, _) = profile.geometry, profile.motor.K_f, profile.inertias
    V_f, V_b = columns["v_front_V"], columns["v_back_V"]
    if axis == "roll":
        acceleration = L.L_a * K_f * (V_f + V_b) / J_roll
    else:
        acceleration = L.L_h * K_f * (V_f - V_b) / J_pitch
    explained = dt**2 * _moving_sum(_moving_sum(acceleration, n), n)
    moved = (angle[2 * n :] - 2 * angle[n:-n] + angle[: -2 * n])[: len(explained)]
    explained = explained[: len(moved)]
    if np.std(explained) < 1e-3 or np.std(moved) == 0:  # rad: about a count
        return None
    ratio = float(np.std(moved) / np.std(explained))
    return ratio, float(np.corrcoef(moved, explained)[0, 1])


def _moving_sum(x: np.ndarray, n: int) -> np.ndarray:
    total = np.concatenate([[0.0], np.cumsum(x)])
    sums: np.ndarray = total[n:] - total[:-n]
    return sums


def wrong_unit(source: str, name: str, evidence: str) -> RecordingError:
    """Return the error for an angle whose name states a wrong unit.

    ``source``: the log; ``name``: the column; ``evidence``: text that shows the error.
    """
    unit = name.rpartition("_")[2]
    true_name = name.removesuffix(unit) + OTHER[unit]
    return RecordingError(
        f"{source}: {name} does not look like {FULL_NAME[unit]}: {evidence}.",
        cause=f"the values are in {FULL_NAME[OTHER[unit]]}{OR_EXCHANGED}",
        fix=f"name the column {true_name} in the header line, or with --map {true_name}=…",
    )

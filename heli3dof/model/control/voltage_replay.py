"""Compute the voltages of a profile's controller from a log's angles; compare them with the log's.

    d[k] = clip(v_logged[k], ±v_max) − control_law(angle[0 … k], reference[0 … k], extra[k])

extra is the logged excitation. d is zero if the profile's controller computed the voltages. If the
controller adds a constant to the angles (half a count), or if its integrals do not start at zero, d
gets a constant and a slope. Both are removed from d in each block of time. The **share** of the
voltages that the controller does not explain is std(d)/std(v_logged)
(`model.control.unexplained_share`). Rows with a motor off or at ±v_max, or without an angle, are
left out.

If the share exceeds `REPRODUCED`, d shows the cause:

* The logged voltage equals the controller's voltage of the previous row: the controller is one
  period late.
* The log has no extra voltage, and d does not depend on the controller's signals (errors, rates,
  integrals): an excitation was added and not logged. d is this excitation.
* Otherwise another controller computed the voltages.

`with_known_controller` prepares a recording for simulated flights (bias correction, null
simulations). If another controller than the profile's computed the voltages, that controller is
identified from the log (`model.control.controller_identification`).
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.control.controller import (
    N_OUT,
    control_law,
    derivative_filter,
    parameters,
    state_at_rest,
)
from heli3dof.model.control.controller_identification import identified_controller
from heli3dof.model.control.loop_task import under_control, why_not_replayed
from heli3dof.model.control.unexplained_share import is_limited, unexplained_share
from heli3dof.model.estimation.decimated_log import decimation
from heli3dof.recording.recording import Recording

REPRODUCED = 0.1
"""Largest share, std(d)/std(v_logged), of the controller that flew. Chosen: on 22 flights of random
rigs the share was below 0.03 for the profile's controller, also with half a count of offset or
other initial integrals. It was above 0.2 for other gains, another filter, one period's delay or an
excitation."""
EXPLAINED = 0.5
"""Share of d's variance that the controller's signals explain, above which d is not an excitation.
Chosen: it was below 0.15 for excitations and above 0.65 for other gains."""
DELAY_KEY = "controller_delay_periods"
"""Key of `Recording.meta`: periods by which the controller is late"""


class Match(enum.Enum):
    """Possible verdicts of `voltage_replay`: does the profile's controller explain the voltages?"""

    REPRODUCED = "reproduced"
    """The profile's controller computes the logged voltages from the logged angles."""
    LATE = "late"
    """The controller is one period late."""
    EXCITED = "excited"
    """An extra voltage was added that the log does not contain."""
    OTHER = "other"
    """Another controller computed the logged voltages."""


@dataclass(frozen=True, eq=False)
class VoltageReplay:
    """The comparison of a profile's controller with the voltages of a recording."""

    match: Match
    share: float
    """Upper quartile of the blocks' shares"""
    std_V: float
    """``share`` times the standard deviation of the logged voltages, the larger of both motors'"""
    difference: np.ndarray
    """(N, 2) V: d without constant and slope; zero in the rows that are left out"""


def voltage_replay(recording: Recording) -> VoltageReplay | None:
    """Return the comparison of the profile's controller with the voltages, or None if impossible.

    The comparison needs a known controller, references, three axes, a row for every control period,
    and enough usable rows (`model.control.unexplained_share`).
    """
    if why_not_replayed(recording) is not None or decimation(recording) != 1:
        return None
    r = under_control(recording)
    v_max = r.profile.motor.v_max
    if not np.isfinite(r.angle[0]).all():
        return None
    logged, voltage = np.clip(r.voltage, -v_max, v_max), _voltage(r)
    late = np.vstack([voltage[:1], voltage[:-1]])
    limited = [is_limited(v, v_max) for v in (logged, voltage, late)]
    rows = np.isfinite(r.angle).all(axis=1) & ~np.logical_or.reduce(limited)
    d = logged - voltage
    t = (r.t - r.t[0])[rows]
    share = unexplained_share(t, d[rows], logged[rows], _detrended_std)
    if share is None:
        return None
    if share <= REPRODUCED:
        match = Match.REPRODUCED
    elif (
        late_share := unexplained_share(t, (logged - late)[rows], logged[rows], _detrended_std)
    ) is not None and late_share <= REPRODUCED:
        match = Match.LATE
    elif np.isnan(recording.voltage_extra).all() and not _is_feedback(r, rows, d):
        match = Match.EXCITED
    else:
        match = Match.OTHER
    difference = np.zeros_like(recording.voltage)
    first = int(np.searchsorted(recording.t, r.t[0]))
    difference[first + np.flatnonzero(rows)] = _residual(_trend(r.t)[rows], d[rows])
    return VoltageReplay(match, share, share * float(logged[rows].std(axis=0).max()), difference)


@lru_cache(maxsize=4)  # both the integrity checks and the diagnosis call it
def with_known_controller(recording: Recording) -> Recording:
    """Return the recording with a controller that reproduces its voltages, if there is one.

    * An excitation that was not logged becomes the result's ``voltage_extra``.
    * If the profile's controller is one period late, `is_late` is true for the result.
    * If another controller than the profile's computed the voltages, the function identifies that
      controller from the log. The result has it as ``identified_controller``. If the identification
      fails, the result has no controller.
    * If the profile has no controller, or the log no reference, the function also identifies the
      controller. If the identification fails, the recording is returned unchanged.
    * In all other cases the recording is returned unchanged.
    """
    result = voltage_replay(recording)
    match = None if result is None else result.match
    if result is not None and match is Match.EXCITED:
        return replace(recording, voltage_extra=result.difference)
    if match is Match.LATE:
        return replace(recording, meta={**recording.meta, DELAY_KEY: 1})
    if match is not Match.OTHER and controller_is_known([recording]):
        return recording
    found = replace(recording, identified_controller=identified_controller(recording))
    if match is Match.OTHER:
        return replace(found, profile=found.profile.model_copy(update={"controller": None}))
    return recording if found.identified_controller is None else found


def controller_is_known(recordings: Sequence[Recording]) -> bool:
    """Return True if every recording has three axes and a known controller.

    A controller is known if it was identified, or if the profile has it and a reference was logged.
    """
    return all(
        len(r.axes) == 3
        and (
            r.identified_controller is not None
            or (r.profile.controller_is_known and any(r.has_reference(a) for a in r.axes))
        )
        for r in recordings
    )


def is_late(recording: Recording) -> bool:
    """Return True if `with_known_controller` found the controller to be one period late."""
    return bool(recording.meta.get(DELAY_KEY))


def _voltage(r: Recording) -> np.ndarray:
    """Return the voltages (N, 2) in V that the profile's controller computes for a recording.

    The inputs of the controller are the recorded angles, references and extra voltages of ``r``.
    The result is after the limiter.
    """
    assert r.profile.controller is not None
    p = parameters(r.profile.controller, r.profile.motor.V_o, r.profile.motor.v_max, r.profile.dt)
    s, voltage = state_at_rest(p, [float(a) for a in r.angle[0]]), np.empty_like(r.voltage)
    _replay(
        np.array(p), np.array(s), *map(np.ascontiguousarray, (r.angle, r.reference)),
        np.nan_to_num(r.voltage_extra), np.empty(N_OUT), voltage,
    )  # fmt: skip
    return voltage


_law = compiled(control_law, leaf=True)


@compiled
def _replay(p, s, angle, reference, extra, out, voltage):  # type: ignore[no-untyped-def]
    for k in range(angle.shape[0]):
        _law(p, s, angle[k], reference[k], extra[k], out)
        voltage[k, 0], voltage[k, 1] = out[2], out[3]


def _detrended_std(t: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the standard deviation (2,) of d (n, 2) about its linear trend over t (n,)."""
    return np.asarray(_residual(_trend(t), d).std(axis=0))


def _trend(t: np.ndarray) -> np.ndarray:
    """Return the regressors (n, 2) of a linear trend over t (n,): a constant and a slope."""
    return np.column_stack([np.ones(len(t)), t - t[0]])


def _is_feedback(r: Recording, rows: np.ndarray, d: np.ndarray) -> bool:
    """Return True if the controller's signals explain more than `EXPLAINED` of the variance of d.

    The signals are the control errors, rates and integrals. d (N, 2) V is logged minus computed
    voltages; ``rows`` (N,) bool selects the rows to use. It is enough if this holds for one motor.
    """
    from scipy.signal import lfilter

    assert r.profile.controller is not None
    b, a1, a2 = derivative_filter(r.profile.controller, r.profile.dt)
    angle = np.nan_to_num(r.angle)
    error = np.nan_to_num(r.reference) - angle
    rates = lfilter([b, 0.0, -b], [1.0, a1, a2], angle - angle[0], axis=0)
    signals = np.column_stack([error, rates, np.cumsum(error, axis=0)])[rows]
    detrended = _residual(_trend(r.t)[rows], d[rows])
    rest = _residual(np.column_stack([_trend(r.t)[rows], signals]), d[rows])
    return bool((1 - rest.var(axis=0) / detrended.var(axis=0)).max() > EXPLAINED)


def _residual(columns: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return d (n, 2) without its least-squares fit to the columns (n, m)."""
    return np.asarray(d - columns @ np.linalg.lstsq(columns, d, rcond=None)[0])

"""Report an encoder's wrong number of counts per revolution, and a wrong gain of the amplifier.

`response` estimates each axis' response g to the voltages: the acceleration that they cause,
divided by the profile's prediction. The checks use only *reliable* responses: those with a small
standard deviation and a high R² (`reliable`). Let encoder i read k_i times the true angle, and let
the thrust be K times the profile's thrust. Then roll r, pitch p and yaw ψ have the responses

    g_r = K k_r          g_p = K k_p          g_ψ = K k_ψ / k_p

g_ψ depends on k_p, because the pitch angle tilts the thrust, which drives yaw.

**Counts.** A decoder counts one, two or four edges of each encoder line. So a wrong number of edges
gives k = 2, 4, ½ or ¼ on one axis. The check computes χ² for each of these hypotheses, and for
k = 1 on all axes. In χ², c_i is k_r, k_p or k_ψ/k_p. h is the hover voltage in flight, divided by
the profile's.

    χ² = min_K Σ_i (ln g_i − ln(K c_i))² / σ² + (ln K)² / σ_K² + (ln(K h))² / σ_K²

σ = `SCATTER` allows for lag, friction and inertia; σ_K = `SPREAD` allows for thrust gain and
counterweight.

* Roll: k_r ≠ 1 also changes g_p and g_ψ, but not by a constant factor, because the equations of
  pitch and yaw contain the roll angle. To test k_r, the check therefore divides roll by k_r and
  estimates all responses again.
* Yaw: The check tests k_ψ only if the response of another axis is also reliable. A wrong k_ψ
  changes yaw's response only. Wrong masses change roll's response by the same factor as yaw's.
* Pitch: The check tests k_p only if yaw's response is also reliable. A wrong k_p changes both g_p
  and g_ψ. Friction, backlash or another inertia changes g_p only.

The check reports the hypothesis with the smallest χ² if this χ² ≤ `FITS`, and every other χ² is
larger by at least `MARGIN`. If the logged angle changes in steps of k counts of the profile's
encoder, these steps also show a wrong k. Then half of `MARGIN` is enough.

The check reports a wrong k as bad data (the most severe kind of fault), with one exception. Half
the axis' inertia has the same effect as k = 2, and twice the inertia the same effect as k = ½. So
the check reports k = 2 or k = ½ only as a note (the mildest kind of fault) if the steps of the
angle do not show k.

If the response of pitch is not reliable, a factor k of yaw's encoder has the same effect as a
factor 1/k of pitch's encoder. The check then reports bad data for every k, and names both causes.

**Amplifier.** If the motors get K times the logged voltages, then g = K on every axis and h = 1/K.
The check reports bad data if K and h differ from 1 by more than the factor `ANOTHER_RIG`, but K h
does not. Smaller deviations of K are usual: thrust gains of one type of rig are 0.13 … 0.22 N/V.
The diagnosis reports them as ``motor.thrust_gain``. h = 3 with g = 1 shows another counterweight
(``mass.imbalance``).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.remedies import angle_remedy, voltage_remedy
from heli3dof.integrity.response import Response
from heli3dof.integrity.view import View
from heli3dof.integrity.voltage import ANOTHER_UNIT, BEYOND
from heli3dof.recording.logs.angle_units import counts_seen

GOOD, PRECISE = 0.7, 0.08
"""Least R², largest relative standard deviation of a reliable response. All limits are chosen."""
DRIVEN = (0.04, 0.1, 0.015)
"""rad/s² by axis: least `Response.drive`; below it, friction and backlash dominate."""
SCATTER, SPREAD = 0.2, 0.35
MARGIN, FITS = 5.0, 6.0
NO_FACTOR = 2.5
"""If χ² with all k = 1 is below this and roll's response is reliable, no other k is tested."""
FACTORS = (0.25, 0.5, 2.0, 4.0)
ANOTHER_RIG = 2.2
SWITCH = 0.25
"""Largest |ln(gain/3)| or |ln(3 gain)| that the amplifier's gain switch explains"""


def reliable(responses: dict[str, Response]) -> dict[str, Response]:
    """Return those of the ``responses`` that are reliable estimates.

    ``responses``: {axis: its response g to the voltages}. g is the acceleration that the voltages
    cause, divided by the profile's prediction. A response is reliable if all of these hold:

    * g is positive, and its standard deviation is below `PRECISE` times g.
    * R² of the estimate (`Response.explained`) exceeds `GOOD`.
    * The predicted acceleration's standard deviation (`Response.drive`) exceeds the axis' limit in
      `DRIVEN`.
    """
    return {
        a: x
        for a, x in responses.items()
        if x.gain > 0
        and x.explained > GOOD
        and x.std < PRECISE * x.gain
        and x.drive > DRIVEN[AXES.index(a)]
    }


def misfit(log_g: dict[str, float], log_k: dict[str, float], h: float | None = None) -> float:
    """Return χ², the misfit between estimated responses g and those that a hypothesis predicts.

    The response g of an axis is the acceleration that the voltages cause, divided by the profile's
    prediction. The hypothesis is a set of encoder factors k. k is an encoder's reading, divided by
    the true angle. ``log_g``: {axis: ln g}; ``log_k``: {axis: ln k}, with ln k = 0 for an axis that
    is not listed. ``h``: hover voltage in flight, divided by the profile's; None if unknown. The
    module's docstring gives the equation.
    """
    expected = {a: log_k.get(a, 0.0) for a in log_g}
    if "yaw" in expected:
        expected["yaw"] -= log_k.get("pitch", 0.0)
    residual = [g - expected[a] for a, g in log_g.items()] + [0.0]
    weight = [1 / SCATTER**2] * len(log_g) + [1 / SPREAD**2]
    if h is not None and h > 0:
        residual.append(-float(np.log(h)))
        weight.append(1 / SPREAD**2)
    e, w = np.array(residual), np.array(weight)
    return float(w @ (e - w @ e / w.sum()) ** 2)


def counts(view: View) -> Iterable[Fault]:
    r = view.recording
    good = reliable(view.responses)
    if not good or _gain_and_hover(view) is not None:
        return
    no_factor = misfit(_logs(good), {}, view.hover_ratio)
    if no_factor < NO_FACTOR and "roll" in good:
        return
    chi2s = {("", 1.0): (no_factor, good)}
    if len(good) > 1:
        for axis in [a for a in good if a == "yaw" or (a == "pitch" and "yaw" in good)]:
            for k in FACTORS:
                fit = misfit(_logs(good), {axis: float(np.log(k))}, view.hover_ratio)
                chi2s[axis, k] = fit, good
    if "roll" in r.axes:
        for k in FACTORS:
            divided = reliable((other := _roll_divided(view, k)).responses)
            if "roll" in divided and len(divided) > 1:
                chi2s["roll", k] = misfit(_logs(divided), {}, other.hover_ratio), divided
    (axis, k), *others = sorted(chi2s, key=lambda name: chi2s[name][0])
    if not axis or not others:
        return
    best, responses = chi2s[axis, k]
    n = int(getattr(r.profile.encoder, axis))
    i = AXES.index(axis)
    fitted = counts_seen(r.angle[view.finite_rows, i], "rad", abs(n))
    # An angle that is k times too large has only every k-th count of the profile's grid.
    coarser = fitted is not None and abs(abs(n) / fitted - k) < 1e-6
    if best > FITS or chi2s[others[0]][0] - best < MARGIN * (0.5 if coarser else 1.0):
        return
    scale = _encoder_factor(axis, k, responses)
    # Without a response of pitch, k of yaw and 1/k of pitch are confounded: sin p drives yaw.
    confounded = axis == "yaw" and "pitch" in r.axes and "pitch" not in good
    inertia = k in (0.5, 2.0) and not coarser and not confounded
    gains = ", ".join(f"{a} {x.gain:.2g}" for a, x in view.responses.items() if x.gain > 0)
    yield Fault(
        "encoder.counts", Kind.NOTE if inertia else Kind.BAD_DATA, r.name,
        f"{r.name}: {axis} moves about {k:g} times as far as its voltages explain"
        + (f", in steps of {k:g} counts" if coarser else "")
        + f" (response over the profile's: {gains}).",
        f"the counts per revolution are wrong by a factor of {k:g} (one, two or four edges of each "
        + ("line are counted)" if confounded else "line are counted).")
        + (f" Or the axis has {'half' if k == 2 else 'twice'} its inertia." if inertia else "")
        + (f", or pitch's by {1 / k:g}, since the tilt drives yaw." if confounded else ""),
        angle_remedy(r, axis, f"{{}}/{k:g}", f"encoder.{axis} = {round(n * k)}"),
        effect="encoder.scale", axis=axis, parameters={"scale": scale},
        confidence=0.5 if confounded or inertia else 0.99,
    )  # fmt: skip


def _logs(responses: dict[str, Response]) -> dict[str, float]:
    return {a: float(np.log(x.gain)) for a, x in responses.items()}


def _roll_divided(view: View, k: float) -> View:
    """Return a view of the recording in which roll's change since the start is divided by ``k``."""
    r = view.recording
    angle = r.angle.copy()
    rest = float(np.median(angle[view.finite_rows, ROLL][:5]))
    angle[:, ROLL] = rest + (angle[:, ROLL] - rest) / k
    divided = View(replace(r, angle=angle))
    divided.sampling_clock = view.sampling_clock  # the same time stamps
    return divided


def _encoder_factor(axis: str, k: float, responses: dict[str, Response]) -> tuple[float, float]:
    """Return the ratio of reading to true angle of an axis' encoder, and its standard deviation.

    ``responses``: the axes' responses to the voltages. The ratio is the response of ``axis``,
    divided by the geometric mean of the other responses. For pitch, this mean leaves out yaw,
    because a wrong pitch angle changes yaw's response. For roll, ``responses`` were estimated after
    roll had been divided by ``k`` (`_roll_divided`), so the ratio is multiplied by ``k``.
    """
    others = [
        np.log(x.gain) for a, x in responses.items() if a != axis and (axis, a) != ("pitch", "yaw")
    ] or [0.0]
    scale = responses[axis].gain / float(np.exp(np.mean(others)))
    if axis == "roll":  # `_roll_divided` has divided roll by k
        scale *= k
    return float(scale), float(scale * SCATTER / np.sqrt(len(others)))


def _gain_and_hover(view: View) -> tuple[float, float] | None:
    """Return (K, h) if the amplifier's gain is wrong, else None.

    K: median over the axes of the measured acceleration divided by the profile's prediction. h:
    hover voltage in flight, divided by the profile's.
    """
    h = view.hover_ratio
    good = reliable(view.responses)
    if h is None or h < ANOTHER_UNIT or not good:
        return None
    K = float(np.exp(np.median([np.log(x.gain) for x in good.values()])))
    far = abs(np.log(h)) > np.log(ANOTHER_RIG) and abs(np.log(K)) > np.log(ANOTHER_RIG)
    return (K, h) if far and abs(np.log(K * h)) < np.log(ANOTHER_RIG) else None


def amplifier(view: View) -> Iterable[Fault]:
    r, gain_and_hover = view.recording, _gain_and_hover(view)
    if gain_and_hover is None:
        return
    K, h = gain_and_hover
    factor = float(np.sqrt(K / h))
    switch = min(abs(np.log(factor * 3)), abs(np.log(factor / 3))) < SWITCH
    V_o, v_max = r.profile.motor.V_o, r.profile.motor.v_max
    if switch:
        times, right = ("3", 3.0) if factor > 1 else ("1/3", 1 / 3)
    else:
        times, right = f"{factor:.3g}", factor
    exceeds = right * float(np.nanmax(np.abs(r.voltage))) > BEYOND * v_max
    remedy = voltage_remedy(r, f"{times}*{{f}}", f"{times}*{{b}}")
    yield Fault(
        "amplifier.gain", Kind.BAD_DATA, r.name,
        f"{r.name}: every axis responds {K:.3g} times as strongly as the profile predicts, and the "
        f"rig hovers at {h * V_o:.3g} V instead of {V_o:.3g} V: the motors get {factor:.3g} times "
        "the logged voltage.",
        "the amplifier's gain switch (1 or 3) differs from the profile and the log."
        if switch else "the voltages were logged before an amplifier or behind a divider.",
        f"{'set the switch, or ' if switch else ''}{remedy}"
        + (f", and multiply motor.v_max by {times}" if exceeds else ""),
        effect="motor.thrust_gain",
        parameters={"gain": (factor, factor * abs(float(np.log(K * h))) / 2)}, confidence=0.99,
    )  # fmt: skip


CHECKS = (
    Check("amplifier.gain", Stage.MOTION, "thrust and hover voltage wrong alike", amplifier),
    Check("encoder.counts", Stage.MOTION, "counts per revolution wrong by 2 or 4", counts),
)

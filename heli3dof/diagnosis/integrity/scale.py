"""Factors of two, three and four: counts per revolution, and the amplifier's gain switch.

If an encoder reads k times its angle and the thrust is K times the profile's, the answers of
`response` are, since yaw is pushed by sin p and pitch reads k_p p:

    g_r = K k_r          g_p = K k_p          g_ψ = K k_ψ / k_p

**Counts.** The wrong number of edges gives k = 2 or 4, or their inverses. Each axis and k is
compared with no k at all, all with K common and free, by

    χ² = Σ (log g − log K − …)² / σ² + (log K)² / σ_K² + (log K h)² / σ_K²

σ = `SCATTER` allows for lag, friction, inertia and an unequal thrust curve, σ_K = `SPREAD` for the
thrust gain and the counterweight. Roll's factor is tried by reading roll anew, since its angle is
in every equation. J_roll and J_yaw are of the same masses, so that one of the two is off by a
factor is no inertia; pitch's factor must show in yaw too, or it may be friction, play or inertia.
The best is named when it beats all else by `MARGIN`. A 2 whose every count is nevertheless seen may
also be half the inertia, and moves the same way: a note, no bad data.

**Amplifier.** T_g is fixed by V_o. If the amplifier multiplies by K what the log says, every answer
is K and the hover voltage is h = 1/K. So K h = 1 with K off by more than `ANOTHER_RIG` is the
amplifier (its gain is 1 or 3 by a switch) or the voltages' scale: bad data. A smaller K is what
rigs differ by (0.13 … 0.22 N/V for one type): the diagnosis names it ``motor.thrust_gain``. h = 3
with answers of 1 is another counterweight: ``mass.imbalance``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage
from heli3dof.diagnosis.integrity.response import Response
from heli3dof.diagnosis.integrity.view import View
from heli3dof.diagnosis.integrity.voltage import ANOTHER_UNIT
from heli3dof.recording.logs.angle_units import counts_seen

GOOD, PRECISE = 0.7, 0.08
"""R² and relative standard deviation of an answer whose size is believed."""
DRIVEN = (0.04, 0.1, 0.015)
"""rad/s² by axis: an axis pushed less than this is at the mercy of friction and play."""
SCATTER, SPREAD = 0.2, 0.35
MARGIN, FITS = 5.0, 6.0
UNSUSPECTED = 2.5
"""χ² without any factor below which none is looked for."""
FACTORS = (0.25, 0.5, 2.0, 4.0)
ANOTHER_RIG = 2.2
SWITCH = 0.25


def believed(answers: dict[str, Response]) -> dict[str, Response]:
    """Those that are positive, precise and explain their axis."""
    return {
        a: x
        for a, x in answers.items()
        if x.gain > 0
        and x.explained > GOOD
        and x.std < PRECISE * x.gain
        and x.drive > DRIVEN[AXES.index(a)]
    }


def misfit(log_g: dict[str, float], log_k: dict[str, float], h: float | None = None) -> float:
    """χ² of answers log g with encoders that read e^{log k} times their angle, K at its best."""
    expected = {a: log_k.get(a, 0.0) for a in log_g}
    if "yaw" in expected:
        expected["yaw"] -= log_k.get("pitch", 0.0)
    seen = [g - expected[a] for a, g in log_g.items()] + [0.0]
    weight = [1 / SCATTER**2] * len(log_g) + [1 / SPREAD**2]
    if h is not None and h > 0:
        seen.append(-float(np.log(h)))
        weight.append(1 / SPREAD**2)
    e, w = np.array(seen), np.array(weight)
    return float(w @ (e - w @ e / w.sum()) ** 2)


def counts(view: View) -> Iterable[Fault]:
    r = view.recording
    good = believed(view.responses)
    if not good or _amplifier(view) is not None:
        return
    plain = misfit(_logs(good), {}, view.hover_ratio)
    if plain < UNSUSPECTED and "roll" in good:
        return
    tried = {("", 1.0): (plain, good)}
    if len(good) > 1:
        for axis in [a for a in good if a == "yaw" or (a == "pitch" and "yaw" in good)]:
            for k in FACTORS:
                fit = misfit(_logs(good), {axis: float(np.log(k))}, view.hover_ratio)
                tried[axis, k] = fit, good
    if "roll" in r.axes:
        for k in FACTORS:
            turned = believed((other := _reading(view, k)).responses)
            if "roll" in turned and len(turned) > 1:
                tried["roll", k] = misfit(_logs(turned), {}, other.hover_ratio), turned
    (axis, k), *others = sorted(tried, key=lambda name: tried[name][0])
    if not axis or not others:
        return
    best, answers = tried[axis, k]
    n = int(getattr(r.profile.encoder, axis))
    i = AXES.index(axis)
    seen = counts_seen(r.angle[view.read, i], "rad", abs(n))
    # Every k-th count of the profile's grid is what k times the angle looks like.
    coarser = seen is not None and abs(abs(n) / seen - k) < 1e-6
    if best > FITS or tried[others[0]][0] - best < MARGIN * (0.5 if coarser else 1.0):
        return
    scale = _scale_of(axis, k, answers)
    # Without pitch's own answer, yaw's k is pitch's 1/k: it is sin p that pushes yaw.
    tied = axis == "yaw" and "pitch" in r.axes and "pitch" not in good
    lighter = k == 2.0 and not coarser and not tied
    told = ", ".join(f"{a} {x.gain:.2g}" for a, x in view.responses.items() if x.gain > 0)
    yield Fault(
        "encoder.counts", Kind.NOTE if lighter else Kind.BAD_DATA, r.name,
        f"{r.name}: {axis} moves about {k:g} times as far as its voltages explain"
        + (f", in steps of {k:g} counts" if coarser else "")
        + f" (response over the profile's: {told}).",
        f"the counts per revolution are wrong by a factor of {k:g} (one, two or four edges of each "
        + ("line are counted)" if tied else "line are counted).")
        + (" Or the axis has half its inertia." if lighter else "")
        + (f", or pitch's by {1 / k:g}, since the tilt drives yaw." if tied else ""),
        f"set encoder.{axis} = {round(n * k)} in the profile if angles come from counts; else "
        f"divide the logged angle by {k:g}",
        effect="encoder.scale", axis=axis, parameters={"scale": scale},
        confidence=0.5 if tied or lighter else 0.99,
    )  # fmt: skip


def _logs(answers: dict[str, Response]) -> dict[str, float]:
    return {a: float(np.log(x.gain)) for a, x in answers.items()}


def _reading(view: View, k: float) -> View:
    """The recording as it would be if roll had been read k times too large, from its rest on.

    Roll's size enters everywhere through cos r, so its answers are computed anew.
    """
    r = view.recording
    angle = r.angle.copy()
    rest = float(np.median(angle[view.read, ROLL][:5]))
    angle[:, ROLL] = rest + (angle[:, ROLL] - rest) / k
    return View(replace(r, angle=angle))


def _scale_of(axis: str, k: float, answers: dict[str, Response]) -> tuple[float, float]:
    """The scale and its standard deviation: the axis's answer over the mean of the others'."""
    others = [
        np.log(x.gain) for a, x in answers.items() if a != axis and (axis, a) != ("pitch", "yaw")
    ] or [0.0]
    scale = answers[axis].gain / float(np.exp(np.mean(others)))
    if axis == "roll":  # answers as if it had been read k times too large
        scale *= k
    return float(scale), float(scale * SCATTER / np.sqrt(len(others)))


def _amplifier(view: View) -> tuple[float, float] | None:
    """K and h where the amplifier's gain is another than the log's."""
    h = view.hover_ratio
    good = believed(view.responses)
    if h is None or h < ANOTHER_UNIT or not good:
        return None
    K = float(np.exp(np.median([np.log(x.gain) for x in good.values()])))
    far = abs(np.log(h)) > np.log(ANOTHER_RIG) and abs(np.log(K)) > np.log(ANOTHER_RIG)
    return (K, h) if far and abs(np.log(K * h)) < np.log(ANOTHER_RIG) else None


def amplifier(view: View) -> Iterable[Fault]:
    r, found = view.recording, _amplifier(view)
    if found is None:
        return
    K, h = found
    factor = float(np.sqrt(K / h))
    switch = min(abs(np.log(factor * 3)), abs(np.log(factor / 3))) < SWITCH
    V_o = r.profile.motor.V_o
    yield Fault(
        "amplifier.gain", Kind.BAD_DATA, r.name,
        f"{r.name}: every axis responds {K:.3g} times as strongly as the profile predicts, and the "
        f"rig hovers at {h * V_o:.3g} V instead of {V_o:.3g} V: the motors get {factor:.3g} times "
        "the logged voltage.",
        "the amplifier's gain switch (1 or 3) differs from the profile and the log."
        if switch else "the voltages were logged before an amplifier or behind a divider.",
        f"set the switch, or multiply the logged voltages (and v_max) by {factor:.3g}",
        effect="motor.thrust_gain",
        parameters={"gain": (factor, factor * abs(float(np.log(K * h))) / 2)}, confidence=0.99,
    )  # fmt: skip


CHECKS = (
    Check("amplifier.gain", Stage.MOTION, "thrust and hover voltage wrong alike", amplifier),
    Check("encoder.counts", Stage.MOTION, "counts per revolution wrong by 2 or 4", counts),
)

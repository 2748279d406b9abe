"""Find a mistake in the profile's lengths that explains fitted inertias far from nominal.

Two lengths are the lever arms of the thrust: L_a from the yaw axis to the body, and L_h from the
pitch axis to a motor. Near level hover, the thrust causes the angular accelerations

    roll     L_a' F/J_roll'
    pitch    L_h' D/J_pitch'
    yaw      −L_a' F sin p/J_yaw'

- L_a', L_h': true lengths of the rig, m
- J': true inertias of the rig, kg·m²
- F, D: sum and difference of the two thrusts, N
- p: pitch angle

The profile may have other lengths, L_a and L_h. A simulation with these lengths gives the same
accelerations if its inertias are

    J = J' L_a/L_a'  for roll and yaw,        J_pitch = J_pitch' L_h/L_h'

So a fit with wrong lengths gives these J. `wrong_lengths` computes them for each usual mistake, and
compares them with the fitted inertias.

Example: the true L_h' is half the distance between the motors. But the profile contains the full
distance, L_h = 2 L_h'. The profile's inertia J_pitch,nominal is proportional to L_h², so it is
4 J_pitch'. The fitted inertia is J_pitch = 2 J_pitch', which is half of J_pitch,nominal.

The fitted inertias compensate for the wrong lengths on each axis separately. The factor on pitch
differs from that on roll and yaw. So the terms of the simulation that couple the axes are wrong.
Their error looks like an unmodelled torque.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.greybox.thrust_scale import Measured, edge
from heli3dof.rig.profile import Profile

FAR = 1.5
"""A factor by which an inertia differs from nominal only if a mass or a length is wrong. Chosen:
measured ones are within the profile's tolerance, 1.15, and the inertia contains a length squared"""
ARMS = {"roll": "L_a", "pitch": "L_h", "yaw": "L_a"}
"""Axis → lever arm of the thrust"""


def wrong_lengths(profile: Profile, ratios: Mapping[str, Measured]) -> dict[str, float]:
    """Return the true lengths {name: m}, if wrong lengths in the profile explain the inertias.

    A fit with wrong lengths gives wrong inertias. There are several usual mistakes, such as a
    length of twice its true value. For each of them, the function computes the inertias that a fit
    with the profile's wrong lengths gives. It chooses the mistake whose computed inertias are
    nearest to the fitted ones. The result contains only the lengths that are wrong in the profile.
    The result is empty in three cases:

    - A ratio is missing in ``ratios``.
    - No fitted inertia is far from nominal (`is_far`).
    - No mistake explains all inertias: for each mistake, a fitted inertia differs from the computed
      one by more than the profile's tolerance.

    ``ratios`` contains the ratios of the thrust gain K_f to the fitted inertias J
    (`identification.profile_update.ratios`). A flight determines K_f/J, but neither K_f nor J
    alone.
    """
    fitted = {a: ratios[f"K_f/J_{a}"] for a in AXES if f"K_f/J_{a}" in ratios}
    if len(fitted) < len(AXES) or not any(map(is_far, fitted.values())):
        return {}
    best, least = dict[str, float](), np.inf
    for lengths in _mistakes(profile):
        x = _deviations(profile, lengths, fitted)
        if all(abs(v) <= abs(edge(v, profile.tolerance)) for v in x) and x @ x < least:
            best, least = lengths, float(x @ x)
    return best


def is_far(m: Measured) -> bool:
    """Return whether a value differs from its nominal one by a factor of more than `FAR`."""
    return not 1 / FAR <= m.value / m.nominal <= FAR


def _mistakes(profile: Profile) -> Iterator[dict[str, float]]:
    """Yield the true lengths {name: m} for each usual mistake in the profile's lengths.

    There are two kinds of mistakes. The profile contains half or twice the true value of one
    length, or it contains two lengths exchanged. The yielded dictionaries contain only the lengths
    that are wrong in the profile.
    """
    L = profile.geometry.model_dump()
    for name, value in L.items():
        yield {name: value / 2}
        yield {name: value * 2}
    names = list(L)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            yield {a: L[b], b: L[a]}


def _deviations(
    profile: Profile, lengths: Mapping[str, float], fitted: Mapping[str, Measured]
) -> np.ndarray:
    """Return ln(J_expected/J_fitted) of the three inertias (3,).

    ``lengths`` {name: m} are assumed to be true lengths, which differ from those of the profile.
    A fit with the profile's lengths would then give the inertias J_expected. ``fitted`` contains
    the ratios K_f/J_fitted; the thrust gain K_f is assumed to be the profile's.
    """
    geometry = profile.geometry.model_copy(update=dict(lengths))
    J = profile.model_copy(update={"geometry": geometry}).inertias
    K_f = profile.motor.K_f
    out = []
    for axis, inertia in zip(AXES, J, strict=True):
        arm = ARMS[axis]
        expected = inertia * getattr(profile.geometry, arm) / getattr(geometry, arm)
        out.append(np.log(expected * fitted[axis].value / K_f))
    return np.array(out)

"""Find a mistake in the profile's lengths that explains fitted inertias far from nominal.

A rig with the true lengths L' (m) and inertias J' (kg·m²) moves with the accelerations

    q̈_roll = L_a' F/J_roll'      q̈_pitch = L_h' D/J_pitch'      ψ̈ = −L_a' F sin p/J_yaw'

F and D are sum and difference of the thrusts (N), p is pitch. The profile has the lengths L. A
simulation with these lengths gives the same accelerations if its inertias are

    J = J' L/L'        with L_a/L_a' for roll and yaw, L_h/L_h' for pitch

So a fit with wrong lengths gives these J. `wrong_lengths` computes them for each usual mistake, and
compares them with the fitted inertias. Example: the arm L_h' is half the distance between the
motors, but the profile contains the full distance, L_h = 2 L_h'. The profile's inertia
J_pitch,nominal is proportional to L_h². So the true inertia is J_pitch' = J_pitch,nominal/4. The
fitted one is J_pitch = 2 J_pitch', half of J_pitch,nominal.

The fitted inertias compensate for the wrong lengths on each axis separately, with another factor on
pitch than on roll and yaw. So the terms of the simulation that couple the axes are wrong. The error
of these terms looks like an unmodelled torque.
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
    """Return corrected lengths {name: m} with which all inertias agree with the profile.

    ``ratios`` contains the ratios of the thrust gain K_f to the fitted inertias J
    (`identification.profile_update.ratios`). A flight determines K_f/J, but neither K_f nor J
    alone. The function tries the usual mistakes in lengths, such as twice the true value. It
    returns the true lengths for the mistake with which the inertias fit best. The result is empty
    in three cases:

    - A ratio is missing.
    - No inertia is far from nominal (`is_far`).
    - With each of the mistakes, an inertia is outside the profile's tolerance.
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
    """Yield for each usual mistake in the profile's lengths the true lengths {name: m}.

    A usual mistake is a length that has half or twice its true value in the profile. Another one is
    that the profile has two lengths exchanged. Lengths that are correct in the profile are omitted.
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

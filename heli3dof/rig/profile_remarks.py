"""Reports legal but unusual values of a profile, for ``profile check`` and ``profile new``.

The balance of the level arm gives a hover voltage per motor, V_m, from the masses
(`heli3dof.rig.profile` explains the symbols)::

    V_m = (L_a (m_f + m_b) − L_w m_w) g / (2 L_a K_f)        positive: body-heavy, rests body down

V_m is inaccurate, because it follows from a small difference of two large torques. Let ε be the
relative standard deviation of each torque (the profile's tolerance). V_m then has the standard
deviation::

    σ = ε √((L_a (m_f + m_b))² + (L_w m_w)²) g / (2 L_a K_f)

σ is often larger than |V_m|. So even the sign of V_m may be wrong, as with the paper's masses
(erratum E2). V_m also omits the arm's own mass. So the hover voltage V_o is measured. Only a
difference from V_m of more than `FAR` standard deviations is reported. The sign of V_o must be that
of −(rest angle): an arm that rests body down needs thrust to rise.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot

from heli3dof.axes import AXES
from heli3dof.rig.profile import Profile, g
from heli3dof.toml_file import key_of, keys, value_at, within

FAR = 2.0
"""Standard deviations of V_m by which V_o may differ from it"""
MOST_OF_THE_AMPLIFIER = 0.6
"""|V_o| as a share of v_max above which too little is left for control"""
INERTIA_RATIO = 1.5
"""Largest permitted ratio, larger to smaller, of a measured inertia and that from the masses"""


def mass_hover_voltage(profile: Profile) -> float:
    """Return the hover voltage V_m per motor, in V, that follows from the masses.

    V_m is negative if the counterweight's torque exceeds that of the body. The paper's eq (6) has
    the opposite sign (erratum E2).
    """
    return -profile.gravity_torque / (2 * profile.geometry.L_a * profile.motor.K_f)


def estimated_hover_voltage(profile: Profile) -> float:
    """Return an estimate of the hover voltage per motor (V), to be used until it is measured.

    V_m is the hover voltage from the masses (`mass_hover_voltage`). The estimate is |V_m| with the
    sign of −(rest angle in roll), or V_m if that angle is 0.
    """
    size = mass_hover_voltage(profile)
    rest = profile.encoder.roll_rest_deg
    return size if rest == 0 else abs(size) * (-1 if rest > 0 else 1)


def unusual_values(profile: Profile) -> Iterator[str]:
    """Yield a sentence for each legal but unusual value of the profile."""
    for name, field in keys(Profile):
        key, value = key_of(field), value_at(profile, name)
        if key is None or key.usual is None or value is None or within(value, key.usual):
            continue
        low, high = key.usual
        slip = key.wrong_unit(value)
        yield (
            f"{name} = {value:g} {key.unit} is unusual (most rigs: {low:g} to {high:g})"
            + (f"; {slip}" if slip else "")
        )
    for axis in AXES:
        counts = getattr(profile.encoder, axis)
        if counts % 4:
            yield (f"encoder.{axis} = {counts} is not a multiple of 4: is it the lines × 4?")
    yield from _hover(profile)
    if profile.inertia is not None:
        for axis, J, masses in zip(AXES, profile.inertias, profile.mass_inertias, strict=True):
            if not 1 / INERTIA_RATIO <= J / masses <= INERTIA_RATIO:
                yield (
                    f"inertia.{axis} = {J:.4g} kg·m² is {J / masses:.2f} times that of the masses "
                    f"({masses:.4g})"
                )
    low, high = profile.limits.roll_min_deg, profile.limits.roll_max_deg
    if not low < profile.encoder.roll_rest_deg < high:
        yield (
            f"encoder.roll_rest_deg = {profile.encoder.roll_rest_deg:g}° lies outside "
            f"limits.roll_min_deg … roll_max_deg ({low:g}° to {high:g}°): every flight from the "
            "table would trip at once"
        )
    if profile.controller is None:
        yield (
            "there is no [controller]: flights use the default gain, and the controller of "
            "imported logs is unknown"
        )


def _hover(profile: Profile) -> Iterator[str]:
    V_o, v_max = profile.motor.V_o, profile.motor.v_max
    if abs(V_o) > MOST_OF_THE_AMPLIFIER * v_max:
        yield (
            f"motor.V_o = {V_o:g} V takes {100 * abs(V_o) / v_max:.0f} % of motor.v_max: little is "
            "left for control"
        )
    L, m = profile.geometry, profile.mass
    masses = mass_hover_voltage(profile)
    std = profile.tolerance * hypot(L.L_a * (m.m_f + m.m_b), L.L_w * m.m_w) * g
    std /= 2 * L.L_a * profile.motor.K_f
    rest = profile.encoder.roll_rest_deg
    if V_o * rest > 0:
        side = "down" if rest < 0 else "up"
        yield (
            f"motor.V_o = {V_o:g} V has the wrong sign for a rig that rests body {side} "
            f"(roll_rest_deg = {rest:g}°)"
        )
    if abs(V_o - masses) > FAR * std:
        heavier = "body" if masses > 0 else "counterweight"
        yield (
            f"motor.V_o = {V_o:g} V, but the masses give {masses:.3g} ± {std:.2g} V "
            f"({heavier}-heavy): measure V_o, and weigh the parts again"
        )

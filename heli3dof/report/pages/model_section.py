"""Write the report's section on models: orders, poles, parameters, Bode diagrams.

A grey-box model is linearised about level hover for poles and Bode diagrams.

V_F and V_B are the front and back motor's voltage. The channels of the Bode diagrams follow the
rig's symmetry: from the common voltage (V_F = V_B = V) to roll, from the difference (V_F = −V_B =
V) to pitch and yaw. A, B, C are the discrete model's matrices, Δt is the sampling interval:

    G(jω) = C (e^{jωΔt} I − A)⁻¹ B,     ω up to 80 % of π/Δt, at most `HIGHEST`
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import CheckFailed
from heli3dof.model.base import Model
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.labels import labels
from heli3dof.model.linear.model import LinearModel
from heli3dof.report.figures.models import LOWEST, BodeCurve, bode_figure
from heli3dof.report.pages.html import figure, table
from heli3dof.report.text.number_format import NONE, fixed, significant
from heli3dof.report.text.table import Grid
from heli3dof.rig.profile import Profile

CHANNELS = {
    "roll / both motors (rad/V)": ("roll", np.array([1.0, 1.0])),
    "pitch / front − back (rad/V)": ("pitch", np.array([1.0, -1.0])),
    "yaw / front − back (rad/V)": ("yaw", np.array([1.0, -1.0])),
}
HIGHEST = 100.0
"""rad/s"""
MOST_POLES = 12


def model_blocks(models: Sequence[Model], profile: Profile | None) -> list[str]:
    """Return HTML strings: tables of the models, poles and parameters, and Bode diagrams."""
    if not models:
        return []
    named = list(zip(labels(models), models, strict=True))
    blocks = [table(models_table(models, profile))]
    blocks += [
        table(parameters_of(replace(m, name=name)))
        for name, m in named
        if isinstance(m, GreyBoxModel)
    ]
    linear = [replace(x, name=name) for name, m in named if (x := linearised(m)) is not None]
    if linear:
        omega, channels = bode_of(linear)
        drawn = bode_figure(omega, channels, title="Bode diagrams of the models")
        blocks.append(figure(drawn, "Magnitude and phase of every model over frequency"))
    return blocks


def linearised(model: Model) -> LinearModel | None:
    """Return a linear form of ``model`` for poles and Bode diagrams; None if it has none.

    The function returns a linear model unchanged, and linearises a grey-box model about level
    hover. The result is None if a grey-box model cannot hover level, and for any other model.
    """
    if isinstance(model, LinearModel):
        return model
    if not isinstance(model, GreyBoxModel):
        return None
    try:
        return model.linear()
    except CheckFailed:
        return None


def parameters_of(model: GreyBoxModel) -> Grid:
    """Return a table of a grey-box model's parameters with their standard deviations."""
    rows = [
        [
            f.name,
            significant(float(v), float(s)),
            significant(float(s), float(s)),
            significant(f.start if f.term is None else f.null),
            "" if f.unit == "–" else f.unit,
        ]
        for f, v, s in zip(model.structure.free, model.values, model.std, strict=True)
    ]
    heads = ["parameter", "value", "standard deviation", "nominal", "unit"]
    return Grid(f"Parameters of {model.name}", heads, rows, prose_columns=1)


def models_table(models: Sequence[Model], profile: Profile | None) -> Grid:
    """Return a table of models: name, kind, order, poles; with ``profile`` closed-loop poles."""
    rows = []
    for name, m in zip(labels(models), models, strict=True):
        order, poles = NONE, NONE
        if (linear := linearised(m)) is not None:
            order, poles = str(linear.order), poles_text(plant_poles(linear))
        loop = NONE
        if profile is not None and profile.controller is not None:
            loop = poles_text(m.loop_poles(profile.controller, profile.dt))
        rows.append([name, m.kind.replace("_", " "), order, poles, loop])
    return Grid(
        "Models and their poles, in rad/s",
        ["model", "kind", "order", "poles", "closed-loop poles"],
        rows,
        notes=["A closed-loop pole in the right half plane means that the model diverges."],
        text_columns=2,
        prose_columns=2,
    )


def plant_poles(model: LinearModel) -> np.ndarray:
    """Return the continuous-time poles log(z)/Δt (rad/s) of a discrete model with the poles z.

    A pole z = 0 (a pure delay) is omitted. The poles of a discretised continuous model are computed
    from the continuous model. The reason: a chain of integrators has a repeated eigenvalue z = 1,
    which is ill-conditioned.
    """
    if model.exact_hold:
        return np.asarray(np.linalg.eigvals(model.continuous().A))
    z = np.linalg.eigvals(model.A).astype(complex)
    return np.asarray(np.log(z[np.abs(z) > 1e-12]) / model.dt)


def poles_text(poles: np.ndarray) -> str:
    """Format poles by decreasing real part, with one entry for each conjugate pair.

    Poles that are equal after rounding also share one entry. At most `MOST_POLES` entries are
    shown.

    >>> poles_text(np.array([-1.5 - 0.79j, -0.1, -1.5 + 0.79j, 0.0, 0.0]))
    '0 (twice), −0.10, −1.50 ± 0.79j'
    """
    upper = sorted((p for p in poles if p.imag >= -1e-9), key=lambda p: (-p.real, p.imag))
    words: list[str] = []
    for p in upper:
        at_zero = abs(p) < 5e-3
        word = "0" if at_zero else fixed(p.real)
        words.append(word if abs(p.imag) < 5e-3 else f"{word} ± {fixed(p.imag)}j")
    parts: list[str] = []
    for word in dict.fromkeys(words):
        n = words.count(word)
        parts.append(word if n == 1 else f"{word} ({'twice' if n == 2 else f'{n} times'})")
    return ", ".join(parts[:MOST_POLES]) + (", …" if len(parts) > MOST_POLES else "")


def bode_of(models: Sequence[LinearModel]) -> tuple[np.ndarray, dict[str, list[BodeCurve]]]:
    """Return frequencies ω in rad/s, and a dict: channel name → models' Bode curves."""
    import control

    fastest = min(HIGHEST, *(0.8 * np.pi / m.dt for m in models))
    omega = np.geomspace(LOWEST, fastest, 240)
    channels: dict[str, list[BodeCurve]] = {}
    for m in models:
        response = control.ss(m.A, m.B, m.C, 0, m.dt)(np.exp(1j * omega * m.dt))
        for name, (axis, motors) in CHANNELS.items():
            if axis in m.axes:
                g = motors @ response[AXES.index(axis)]
                channels.setdefault(name, []).append(BodeCurve(m.name, m.kind, g))
    return omega, channels

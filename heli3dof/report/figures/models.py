"""Draw Bode diagrams of models with uncertainty bands, and residuals with their autocorrelation.

A Bode diagram shows magnitude 20 log₁₀ |G(jω)| (dB) and phase arg G(jω) (degrees) over ω (rad/s). A
band is ± two standard deviations of G:

    |G| ± 2σ_|G|,    arg G ± 2σ_|G|/|G|   (circular uncertainty, small against |G|)

N residuals of a correct model are white: the autocorrelation R(τ)/R(0) is within ± 2.58/√N at 99 %
of the lags τ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import UsageError
from heli3dof.identification.result import Identification
from heli3dof.report.figures.labelled_curves import short_label
from heli3dof.report.figures.style import BLUE, GRID, SOFT, SYMBOLS, Line, model_lines, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 200
LOWEST = 0.1
"""rad/s: lowest frequency of the Bode diagrams; one-minute flights hold no information below."""
MIN_PHASE_SPAN = 90.0
"""Least range of a phase axis, degrees (a convention)"""
LAGS_S = 0.5
"""s, the largest lag of the autocorrelation"""


@dataclass(frozen=True, eq=False)
class BodeCurve:
    """A model's complex response at M frequencies, and the standard deviation of its modulus."""

    label: str
    kind: str
    response: np.ndarray
    std: np.ndarray | None = None


def bode_figure(
    omega: np.ndarray, channels: Mapping[str, Sequence[BodeCurve]], *, title: str
) -> Figure:
    """Draw Bode diagrams at ω (M,) rad/s, one column for each channel.

    ``channels`` maps a channel's name, such as ``roll / front (rad/V)``, to the curves of the
    models.
    """
    n = len(channels)
    width, height = max(4.4, 3.0 * n), 4.9
    with new_figure(width, height, title) as figure:
        grid = figure.subplots(
            2,
            n,
            sharex=True,
            squeeze=False,
            gridspec_kw={
                "hspace": 0.12,
                "wspace": 0.3,
                "left": 0.82 / width,
                "right": 1 - 0.12 / width,
                "top": 1 - 0.72 / height,
                "bottom": 0.85 / height,
            },
        )
        for (name, curves), (magnitude, phase) in zip(channels.items(), grid.T, strict=True):
            for c, line in zip(curves, model_lines([c.kind for c in curves]), strict=True):
                _bode_curve(magnitude, phase, omega, c, line)
            magnitude.set_title(name, fontsize=9.5, color=SOFT, loc="left")
            magnitude.set_xscale("log")
            low, high = phase.get_ylim()
            short = max(0.0, MIN_PHASE_SPAN - (high - low)) / 2
            phase.set_ylim(low - short, high + short)
            phase.set_xlabel("ω (rad/s)")
        grid[0, 0].set_ylabel("magnitude (dB)")
        grid[1, 0].set_ylabel("phase (°)")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=max(1, len(labels)))
        figure.align_ylabels()
    return figure


def bode_with_bands(found: Identification):  # type: ignore[no-untyped-def]
    """Draw Bode diagrams from the front motor to each angle; None without a linear response."""
    omega = np.geomspace(LOWEST, 0.8 * np.pi / found.interval_s, POINTS)
    try:
        response, std = found.frequency_response(omega)
    except UsageError:
        return None
    channels = {
        f"{axis} / front (rad/V)": [
            BodeCurve(
                found.model.name,
                found.model.kind,
                response[:, i, 0],
                std[:, i, 0] if np.isfinite(std[:, i, 0]).all() else None,
            )
        ]
        for i, axis in enumerate(AXES)
    }
    return bode_figure(omega, channels, title=f"Bode diagrams of {found.model.name}")


def _bode_curve(magnitude, phase, omega, c: BodeCurve, line: Line) -> None:  # type: ignore[no-untyped-def]
    size = np.abs(c.response)
    angle = np.degrees(np.unwrap(np.angle(c.response)))
    angle -= 360 * np.ceil(angle[0] / 360 - 1e-6)  # every curve starts between −360° and 0°
    magnitude.plot(omega, _db(size), label=short_label(c.label), **line.kwargs())
    phase.plot(omega, angle, label=short_label(c.label), **line.kwargs())
    if c.std is not None:
        low, high = np.maximum(size - 2 * c.std, 0.05 * size), size + 2 * c.std
        spread = np.degrees(np.minimum(2 * c.std / size, np.pi / 2))
        shade = {"color": line.color, "alpha": 0.18, "linewidth": 0}
        magnitude.fill_between(omega, _db(low), _db(high), **shade)
        phase.fill_between(omega, angle - spread, angle + spread, **shade)


def _db(size: np.ndarray) -> np.ndarray:
    return np.asarray(20 * np.log10(np.maximum(size, 1e-300)))


def residual_figure(t: np.ndarray, residual: np.ndarray) -> Figure:
    """Draw innovations (N, 3) in rad over times t (N,) in s, and their autocorrelation by axis."""
    there = [i for i in range(len(AXES)) if np.isfinite(residual[:, i]).any()]
    dt = float(np.median(np.diff(t)))
    height = 1.1 + 1.5 * max(len(there), 1)
    with new_figure(8.6, height, "Innovations on held-out data") as figure:
        grid = figure.subplots(
            max(len(there), 1),
            2,
            sharex="col",
            squeeze=False,
            gridspec_kw={
                "hspace": 0.22,
                "wspace": 0.24,
                "left": 0.09,
                "right": 0.985,
                "top": 1 - 0.55 / height,
                "bottom": 0.5 / height,
                "width_ratios": (1.7, 1),
            },
        )
        for i, (series, correlation) in zip(there, grid, strict=False):
            e = residual[:, i]
            series.plot(t, np.degrees(e) * 1e3, color=BLUE, linewidth=0.7, label=AXES[i])
            series.set_ylabel(f"{AXES[i]} {SYMBOLS[AXES[i]]} (m°)")
            lags, r, bound = autocorrelation(e[np.isfinite(e)], dt)
            correlation.axhspan(-bound, bound, color=GRID, zorder=0)
            # R(0) is always 1
            correlation.vlines(lags[1:], 0, r[1:], color=BLUE, linewidth=1.0, label=AXES[i])
            reach = 1.15 * max(3 * bound, float(abs(r[1:]).max(initial=0.0)))
            correlation.set_ylim(-reach, reach)
        grid[-1, 0].set_xlabel("time (s)")
        grid[-1, 1].set_xlabel("lag (s)")
        grid[0, 0].set_title("residual", fontsize=9.5, color=SOFT, loc="left")
        grid[0, 1].set_title(
            "autocorrelation; band: 99 % if white", fontsize=9.5, color=SOFT, loc="left"
        )
        figure.align_ylabels()
    return figure


def autocorrelation(residual: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return lags τ (s), R(τ)/R(0) and the 99 % bound 2.58/√N that holds for white noise.

    R is the autocorrelation of ``residual`` (N,), sampled every ``dt`` s; τ ends at `LAGS_S`.
    """
    e = residual - residual.mean()
    n = len(e)
    lags = np.arange(min(round(LAGS_S / dt), n - 1) + 1)
    spectrum = np.abs(np.fft.rfft(e, 2 * n)) ** 2  # zero-padded against circular correlation
    r = np.fft.irfft(spectrum)[: len(lags)]
    return lags * dt, r / (r[0] or 1.0), 2.58 / float(np.sqrt(n))

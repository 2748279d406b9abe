"""`identify`: recordings in, a model with its uncertainty and its faults out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.identification.feedback import Feedback, feedback_test
from heli3dof.identification.prepare import Prepared, prepare, segments
from heli3dof.identification.residuals import ResidualTest, past_inputs, whiteness
from heli3dof.identification.search import (
    INTERVALS_S,
    ORDERS,
    Candidate,
    StateSpaceFit,
    decimated,
    search,
)
from heli3dof.identification.statistics import Pole, poles, polynomials, propagate, response_std
from heli3dof.identification.tf4 import fit_tf4, state_space
from heli3dof.identification.transfer import TransferFunctions
from heli3dof.identification.validate import Metrics, metrics
from heli3dof.model.linear import LinearModel
from heli3dof.recording.recording import Recording

Method = Literal["pem", "pbsid", "tf4", "oe"]
METHODS: dict[str, str] = {
    "pem": "prediction error in innovation form, started from PBSID-opt",
    "pbsid": "PBSID-opt subspace identification",
    "tf4": "the paper's form: common fourth-order denominator, output error",
    "oe": "output error (K = 0) in state-space form",
}
FEEDBACK_TEST_S = 0.02
TF4_INTERVAL_S = 0.04
OE_WARNING = (
    "Output error takes the voltages as independent of the disturbances, but in closed loop they "
    "answer them, and yaw integrates, so simulated errors pile up: its parameters are biased and "
    "its standard deviations are far too small. It is here to reproduce the paper; use pem."
)


@dataclass(frozen=True, eq=False)
class Identification:
    """A model and everything that is known of how good it is."""

    method: str
    model: LinearModel
    """At the control rate, ready to fly, predict and save."""
    interval_s: float
    """s between the samples that it was fitted to."""
    poles: tuple[Pole, ...]
    transfer: TransferFunctions
    """Continuous time, rad/V; printed in degrees/V."""
    metrics: Metrics
    residuals: tuple[ResidualTest, ...]
    feedback: Feedback
    prepared: Prepared
    candidates: tuple[Candidate, ...]
    warnings: tuple[str, ...]
    fit: StateSpaceFit | None
    """The state-space fit behind it; None for tf4."""

    def frequency_response(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """G (F, 3, 2) complex and its standard deviation, rad/V, at ω (F,) rad/s."""
        c = self.model.continuous()
        eye = np.eye(self.model.order)
        G = np.array([c.C @ np.linalg.solve(1j * w * eye - c.A, c.B) + c.D for w in omega])
        if self.fit is None or self.fit.pem is None:
            return G, np.full(G.shape, np.nan)
        return G, response_std(self.fit.pem, self.interval_s, omega)

    def sentences(self) -> list[str]:
        """What to tell the user, a line each."""
        out = [line for r in self.prepared.reports for line in r.sentences()]
        out.append(self.feedback.sentence)
        out.append(
            f"{self.method}: {METHODS[self.method]}; order {self.model.order}, "
            f"fitted every {self.interval_s * 1e3:g} ms; {self.prepared.split}."
        )
        out += [t.sentence() for t in self.residuals]
        out += [f"Warning: {w}" for w in self.warnings]
        return out

    def to_json(self, file: str | None = None) -> dict[str, Any]:
        """One model of the contract's ``identify --json``. ``file`` is where it was saved."""
        return {
            "name": self.model.name,
            "kind": self.model.kind,
            "method": self.method,
            "file": file,
            "order": self.model.order,
            "interval_s": self.interval_s,
            "poles": [
                {
                    "re_per_s": p.value.real,
                    "im_per_s": p.value.imag,
                    "re_std_per_s": p.std_real,
                    "im_std_per_s": p.std_imag,
                }
                for p in self.poles
            ],
            "transfer_function": self.transfer.to_json(),
            **self.metrics.to_json(),
            "residual_tests": {t.name.replace(" ", "_"): t.to_json() for t in self.residuals},
            "feedback": {
                "present": self.feedback.present,
                "statistic": self.feedback.statistic,
                "degrees_of_freedom": self.feedback.degrees_of_freedom,
                "p_value": self.feedback.p_value,
                "share": self.feedback.share,
                "sentence": self.feedback.sentence,
            },
            "preparation": [_report_json(r) for r in self.prepared.reports],
            "validation": self.prepared.split,
            "candidates": [c.to_json() for c in self.candidates],
            "warnings": list(self.warnings),
        }


def identify(
    recordings: Recording | Sequence[Recording],
    *,
    method: Method = "pem",
    order: int | None = None,
    holdout: Recording | Sequence[Recording] | None = None,
    intervals_s: Sequence[float] = INTERVALS_S,
    name: str | None = None,
) -> Identification:
    """Identify a black-box model from recordings of one rig.

    Args:
        recordings: one or several, all three angles, the same sample interval; all are fitted
            together.
        method: ``pem`` (the one to use), ``pbsid``, ``tf4`` (the paper's form) or ``oe``.
        order: number of states; None chooses (see `heli3dof.identification.search`). Not for tf4.
        holdout: recordings to validate on. None sets aside the last quarter of each recording.
        intervals_s: sampling intervals (s) to try; each becomes a multiple of the control period.
        name: of the model; None names it after the method.

    Returns:
        An `Identification`: the model, poles and transfer functions with standard deviations,
        metrics on held-out data only, residual tests, and what to be warned of.

    Raises:
        UsageError: an unknown method or an impossible order.
        RecordingError: recordings that cannot carry a fit; says which and why.
    """
    if method not in get_args(Method):
        raise UsageError(
            f"There is no method {method!r}.",
            cause=did_you_mean(method, METHODS),
            fix="--method with one of " + ", ".join(METHODS),
        )
    if order is not None and not (1 <= order <= 20):
        raise UsageError(
            f"--order {order} cannot be: a model has 1 to 20 states.",
            cause="the rig itself has eight: six of its body, two of its rotors.",
            fix="leave --order out to have it chosen",
        )
    prepared = prepare(_several(recordings), held_out=_several(holdout))
    near = segments(prepared, prepared.train, max(1, round(FEEDBACK_TEST_S / prepared.dt)))
    feedback = feedback_test([(s.u, s.y) for s in near])
    name = name or method
    if method == "tf4":
        found = _tf4(prepared, name)
    else:
        found = _state_space(prepared, method, order, tuple(intervals_s), name)
    model, interval_s, found_poles, transfer, candidates, fit, said = found
    if method in ("oe", "tf4") and feedback.present:
        said = (OE_WARNING, *said)
    return Identification(
        method,
        replace(model, extra=_extra(method, interval_s, found_poles, prepared)),
        interval_s,
        found_poles,
        transfer,
        metrics(model, prepared, prepared.held_out),
        _residual_tests(model, fit, prepared, interval_s),
        feedback,
        prepared,
        candidates,
        (*_warnings(prepared), *said),
        fit,
    )


_Found = tuple[
    LinearModel,
    float,
    tuple[Pole, ...],
    TransferFunctions,
    tuple[Candidate, ...],
    StateSpaceFit | None,
    tuple[str, ...],
]


def _state_space(
    prepared: Prepared, method: str, order: int | None, intervals_s: tuple[float, ...], name: str
) -> _Found:
    orders = ORDERS if order is None else (order,)
    fit, tried = search(method, prepared, orders=orders, intervals_s=intervals_s, name=name)
    T = fit.interval_s
    said = []
    if fit.pem is None:
        num, den = polynomials(fit.state_space, T)
        lam = np.linalg.eigvals(fit.state_space.A).astype(complex)
        found = [Pole(complex(np.log(z)) / T, np.nan, np.nan) for z in lam]
        found.sort(key=lambda p: (-p.value.real, p.value.imag))
        said.append("PBSID gives no standard deviations; pem, which starts from it, does.")
        transfer = TransferFunctions(num, den)
    else:
        if not fit.pem.converged:
            said.append(
                f"The fit had not settled after {fit.pem.iterations} steps; more data, or a lower "
                "order, would make it better determined."
            )
        found = poles(fit.pem, T)

        def coefficients(model: Any) -> np.ndarray:
            num, den = polynomials(model, T)
            return np.concatenate([den[1:], num.ravel()])

        num, den = polynomials(fit.state_space, T)
        transfer = TransferFunctions(num, den, propagate(fit.pem, coefficients))
    return fit.model, T, tuple(found), transfer, tuple(tried), fit, tuple(said)


def _tf4(prepared: Prepared, name: str) -> _Found:
    d = decimated(prepared, prepared.train, TF4_INTERVAL_S)
    fit = fit_tf4(d.data, d.interval_s)
    A, B, C = state_space(fit, prepared.dt)
    model = LinearModel(
        name=name,
        kind="tf4",
        A=A,
        B=B,
        C=C,
        K=np.zeros((len(A), 3)),
        S=fit.S,
        u0=d.u_mean,
        y0=d.y_mean + fit.offset,
        dt=prepared.dt,
        exact_hold=True,
    )
    den = fit.transfer.den
    cov = fit.transfer.covariance
    assert cov is not None
    found = []
    for s in np.roots(den):
        g = -(s ** np.arange(3, -1, -1)) / np.polyval(np.polyder(den), s)
        std = [float(np.sqrt(max(part @ cov[:4, :4] @ part, 0))) for part in (g.real, g.imag)]
        found.append(Pole(complex(s), *std))
    found.sort(key=lambda p: (-p.value.real, p.value.imag))
    said = (
        "Fourth order cannot hold this plant, which has at least six states and an integrator in "
        "yaw (erratum E14 of the paper).",
    )
    return model, d.interval_s, tuple(found), fit.transfer, (), None, said


def _residual_tests(
    model: LinearModel, fit: StateSpaceFit | None, prepared: Prepared, interval_s: float
) -> tuple[ResidualTest, ...]:
    """On held-out data, at the interval of the fit, where innovations claim to be white."""
    from heli3dof.identification.stable import with_stable_predictor
    from heli3dof.identification.validate import WARM_UP_S

    d = decimated(prepared, prepared.held_out, interval_s)
    if fit is None:
        ss = None
    else:
        ss = fit.state_space
        if fit.model.K.any():
            ss = with_stable_predictor(ss, rho=1 - 1e-6)
    settle = round(WARM_UP_S / interval_s)
    E, U = [], []
    for u, y in d.data:
        if ss is None:
            e = _simulation_error(model, u + d.u_mean, y + d.y_mean, interval_s)
        else:
            assert fit is not None
            from heli3dof.identification.predictor import filter_states

            u1 = np.ascontiguousarray(u + d.u_mean - fit.u_mean)
            y1 = np.ascontiguousarray(y + d.y_mean - fit.y_mean)
            x0 = np.zeros(ss.order)
            x = filter_states(
                np.ascontiguousarray(ss.At), np.ascontiguousarray(ss.B),
                np.ascontiguousarray(ss.K), u1, y1, x0,
            )  # fmt: skip
            e = y1 - x @ ss.C.T - ss.d
        if len(e) > settle + 60:
            E.append(e[settle:])
            U.append(u[settle:])
    if not E:
        return ()
    return whiteness(E), past_inputs(E, U)


def _simulation_error(
    model: LinearModel, u: np.ndarray, y: np.ndarray, interval_s: float
) -> np.ndarray:
    """y minus the simulation from the best initial state, (N, 3) rad."""
    from heli3dof.identification.predictor import filter_states, free_responses

    at = model.at(interval_s)
    A, B = np.ascontiguousarray(at.A), np.ascontiguousarray(at.B)
    C = np.ascontiguousarray(at.C)
    x = filter_states(
        A, B, np.zeros((len(A), 3)), np.ascontiguousarray(u - at.u0), y, np.zeros(len(A))
    )
    e = y - at.y0 - x @ C.T
    O = free_responses(A, C, len(u)).reshape(-1, len(A))
    x0 = np.linalg.lstsq(O, e.ravel(), rcond=1e-10)[0]
    return np.asarray(e - (O @ x0).reshape(e.shape))


def _warnings(prepared: Prepared) -> tuple[str, ...]:
    out = []
    for r in prepared.reports:
        c = r.clock
        if abs(c.period_s / c.nominal_s - 1) > 0.01:
            out.append(
                f"{r.name} was logged every {c.period_s * 1e3:.4g} ms, its loop ran every "
                f"{c.nominal_s * 1e3:.4g} ms: voltages between samples are unknown, which biases "
                "the rotor lag most. Log at the control rate."
            )
        if c.jitter_s > 0.05 * c.period_s:
            out.append(
                f"{r.name}: samples come {c.jitter_s * 1e3:.2g} ms early or late "
                f"({100 * c.jitter_s / c.period_s:.0f} % of the period). heli3dof doctor"
            )
        if c.lost_share > 0.01:
            out.append(f"{r.name}: {100 * c.lost_share:.1f} % of the samples are missing.")
        if r.clipped_share > 0.05:
            out.append(
                f"{r.name}: {100 * r.clipped_share:.0f} % of the rows fly at the amplifier's "
                "limit, where the loop is open for a while."
            )
    return tuple(out)


def _extra(
    method: str, interval_s: float, found: tuple[Pole, ...], prepared: Prepared
) -> dict[str, Any]:
    used = sorted({r.source for r in prepared.train})
    return {
        "method": method,
        "interval_s": interval_s,
        "recordings": [
            {"name": prepared.recordings[i].name, "sha256": prepared.recordings[i].digest}
            for i in used
        ],
        "poles": [[p.value.real, p.value.imag, p.std_real, p.std_imag] for p in found],
    }


def _report_json(report: Any) -> dict[str, Any]:
    c = report.clock
    return {
        "recording": report.name,
        "duration_s": report.seconds,
        "period_s": c.period_s,
        "control_period_s": c.nominal_s,
        "jitter_s": c.jitter_s,
        "gaps": c.gaps,
        "lost_share": c.lost_share,
        "usable_share": report.usable_share,
        "left_out_share": report.left_out,
        "clipped_share": report.clipped_share,
        "segments": report.segments,
    }


def _several(recordings: Recording | Sequence[Recording] | None) -> list[Recording]:
    if recordings is None:
        return []
    return [recordings] if isinstance(recordings, Recording) else list(recordings)

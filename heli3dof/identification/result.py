"""`Identification`: a model, its uncertainty, how good it is and what to be warned of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from heli3dof.errors import UsageError
from heli3dof.identification.feedback import Feedback
from heli3dof.identification.fit_result import Found
from heli3dof.identification.methods import METHODS
from heli3dof.identification.preprocessing import Prepared, RecordingReport
from heli3dof.identification.residual_tests import ResidualTest
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.identification.uncertainty import Pole
from heli3dof.identification.validation import Metrics
from heli3dof.model.base import Model
from heli3dof.model.model_file import jsonable


@dataclass(frozen=True, eq=False)
class Identification:
    """What `heli3dof.identify` hands back."""

    method: str
    model: Model
    """At the control rate, ready to fly, predict and save. Black boxes are `LinearModel`s."""
    found: Found
    """What the method itself handed back."""
    metrics: Metrics
    """On held-out data only."""
    residuals: tuple[ResidualTest, ...]
    """On held-out data, at the interval of the fit."""
    feedback: Feedback
    prepared: Prepared
    warnings: tuple[str, ...]

    @property
    def order(self) -> int:
        return self.found.order

    @property
    def interval_s(self) -> float:
        """s between the samples that the model was fitted to."""
        return self.found.interval_s

    @property
    def poles(self) -> tuple[Pole, ...]:
        """Continuous time, 1/s, with standard deviations; rightmost first."""
        return self.found.poles

    @property
    def transfer(self) -> TransferFunctions:
        """Continuous time, rad/V; its lines are printed in degrees/V.

        Raises UsageError for a model that has none (`Found.transfer` is None).
        """
        if self.found.transfer is None:
            raise UsageError(f"A model by {self.method} has no transfer functions.")
        return self.found.transfer

    def frequency_response(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """G (F, 3, 2) complex and its standard deviation, rad/V, at ω (F,) rad/s.

        The deviation is that of |G − Ĝ|; NaN where the method knows none. Raises UsageError for a
        model that has no linear response.
        """
        if self.found.response is None:
            raise UsageError(f"A model by {self.method} has no frequency response.")
        return self.found.response(np.asarray(omega, dtype=float))

    def sentences(self) -> list[str]:
        """What to tell the user, a line each."""
        out = [line for r in self.prepared.reports for line in r.sentences()]
        out.append(self.feedback.sentence)
        out.append(
            f"{self.method}: {METHODS[self.method].sentence}; order {self.order}, "
            f"fitted every {self.interval_s * 1e3:g} ms; {self.prepared.split}."
        )
        out += [t.sentence() for t in self.residuals]
        out += [f"Warning: {w}" for w in self.warnings]
        return out

    def to_json(self, file: str | None = None) -> dict[str, Any]:
        """One model of the contract's ``identify --json``. ``file`` is where it was saved.

        Numbers that are not known are null.
        """
        f = self.feedback
        document: dict[str, Any] = {
            "name": self.model.name,
            "kind": self.model.kind,
            "method": self.method,
            "file": file,
            "order": self.order,
            "interval_s": self.interval_s,
        }
        if self.found.parameters:
            document["parameters"] = {
                name: {
                    "value": p.value,
                    "std": p.std,
                    "unit": p.unit,
                    "cramer_rao_bound": p.bound,
                    "nominal": p.nominal,
                    "verdict": p.verdict,
                }
                for name, p in self.found.parameters.items()
            }
        if self.found.correlation is not None:
            document["correlation"] = self.found.correlation
        if self.poles:
            document["poles"] = [pole_json(p) for p in self.poles]
        if self.found.transfer is not None:
            document["transfer_function"] = self.found.transfer.to_json()
        document |= {
            **self.metrics.to_json(),
            "residual_tests": {t.name.replace(" ", "_"): t.to_json() for t in self.residuals},
            "feedback": {
                "present": f.present,
                "statistic": f.statistic,
                "degrees_of_freedom": f.degrees_of_freedom,
                "p_value": f.p_value,
                "share": f.share,
                "sentence": f.sentence,
            },
            "preparation": [report_json(r) for r in self.prepared.reports],
            "validation": self.prepared.split,
            "candidates": [c.to_json() for c in self.found.candidates],
            "warnings": list(self.warnings),
        }
        plain: dict[str, Any] = jsonable(document)
        return plain


def pole_json(pole: Pole) -> dict[str, float]:
    """Real and imaginary part with standard deviations, 1/s."""
    return {
        "re_per_s": pole.value.real,
        "im_per_s": pole.value.imag,
        "re_std_per_s": pole.std_real,
        "im_std_per_s": pole.std_imag,
    }


def report_json(report: RecordingReport) -> dict[str, Any]:
    """What preparation found in one recording."""
    c = report.clock
    return {
        "recording": report.name,
        "duration_s": report.seconds,
        "period_s": c.period_s,
        "control_period_s": c.nominal_s,
        "jitter_s": c.jitter_s,
        "gaps": c.gaps,
        "long_gaps": c.long_gaps,
        "lost_share": c.lost_share,
        "usable_share": report.usable_share,
        "left_out_share": report.left_out,
        "clipped_share": report.clipped_share,
        "segments": report.segments,
    }

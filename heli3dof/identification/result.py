"""`Identification`: a model with its uncertainty, its scores and its warnings."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.arrays import ComplexArray, FloatArray
from heli3dof.axes import AXES
from heli3dof.errors import UsageError
from heli3dof.identification.factored_transfer_function import FactoredTransferFunction
from heli3dof.identification.feedback import Feedback
from heli3dof.identification.fit_result import FitResult, Pole
from heli3dof.identification.methods import known_method
from heli3dof.identification.preprocessing import Prepared
from heli3dof.identification.reduction import factored
from heli3dof.identification.residual_tests import ResidualTest
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.identification.validation import Metrics, Score
from heli3dof.json_values import jsonable
from heli3dof.model.base import Model
from heli3dof.results import Result, optional

if TYPE_CHECKING:
    from pandas import DataFrame

SUMMARY_HORIZON_S = 1.0
"""s: prediction horizon of the fit (%) in summaries. At shorter horizons every model fits to nearly
100 %."""


def no_linear_form(method: str, what: str) -> UsageError:
    """Return a UsageError that states that a model by ``method`` has no ``what``."""
    return UsageError(
        f"A model by {method} has no {what}.",
        cause="its method returns no linear model.",
        fix="heli3dof identify REC.mcap --method greybox",
    )


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Result):
    """The result of `heli3dof.identify`: the model, its uncertainty, held-out scores, warnings."""

    method: str
    model: Model
    """The model at the control rate, ready to fly, predict and save; black boxes: `LinearModel`."""
    found: FitResult
    """The fit that the identification method returned"""
    metrics: Metrics
    """Scores of the model on held-out data only"""
    residuals: tuple[ResidualTest, ...]
    """Residual tests on held-out data, at the interval `FitResult.test_interval_s`"""
    feedback: Feedback
    prepared: Prepared
    warnings: tuple[str, ...]

    @property
    def order(self) -> int:
        return self.found.order

    @property
    def interval_s(self) -> float:
        """Return the sampling interval (s) of the data that were fitted."""
        return self.found.interval_s

    @property
    def poles(self) -> tuple[Pole, ...]:
        """Return the continuous-time poles (rad/s) with standard deviations, rightmost first."""
        return self.found.poles

    @property
    def transfer(self) -> TransferFunctions:
        """Return the continuous-time transfer functions in rad/V; ``lines()`` prints degrees/V.

        Raises UsageError for a model that has none (`FitResult.transfer` is None).
        """
        if self.found.transfer is None:
            raise no_linear_form(self.method, "transfer functions")
        return self.found.transfer

    @cached_property
    def factored(self) -> tuple[FactoredTransferFunction, ...]:
        """Return the transfer functions as gain and factors, without insignificant factors.

        The order is roll, pitch, yaw, and for each angle the sum and the difference of the
        voltages. ``str()`` of a transfer function is in degrees/V; its method ``to_control()``
        returns a python-control object in rad/V. Raises UsageError as `transfer` does.
        `heli3dof.identification.reduction` explains the method.
        """
        return factored(self.transfer, self.interval_s, self.poles)

    def frequency_response(self, omega: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return the response G (F, 3, 2) and its standard deviation, rad/V, at ω (F,) rad/s.

        The standard deviation is √(var Re G + var Im G), or NaN if the method gives none. Raises
        UsageError for a model without a linear response.
        """
        if self.found.response is None:
            raise no_linear_form(self.method, "frequency response")
        return self.found.response(np.asarray(omega, dtype=float))

    def sentences(self) -> list[str]:
        """Return the result as lines of text for the terminal and the report."""
        out = [line for r in self.prepared.reports for line in r.sentences()]
        out.append(self.feedback.sentence)
        out.append(
            f"{self.method}: {known_method(self.method).sentence}; order {self.order}, "
            f"fitted every {self.interval_s * 1e3:g} ms; {self.prepared.split}."
        )
        out += [t.sentence() for t in self.residuals]
        out += self.found.notes
        out += [f"Warning: {w}" for w in self.warnings]
        return out

    def summary(self) -> str:
        """Return a summary: method, held-out scores, residual tests, parameters, warnings."""
        ahead = self.metrics.prediction[SUMMARY_HORIZON_S]
        replay = self.metrics.replay_note or _by_axis(self.metrics.replay)
        tests = [f"{t.name} {'passed' if t.passed else 'not passed'}" for t in self.residuals]
        lines = [
            f"model {self.model.name!r} by {self.method}: order {self.order}, "
            f"fitted every {self.interval_s * 1e3:g} ms",
            f"held-out fit {SUMMARY_HORIZON_S:g} s ahead: {_by_axis(ahead)}; "
            f"closed-loop replay: {replay}",
            f"residuals: {', '.join(tests) or 'not tested'}; warnings: {len(self.warnings)}",
        ]
        for name, p in self.found.parameters.items():
            lines.append(f"  {name} = {p.value:.4g} ± {p.std:.2g} {p.unit}")
        if not self.found.parameters:
            lines += [f"  pole {p.value:.4g} 1/s" for p in self.poles]
        if self.found.transfer is not None:
            lines += [f"  {f.output} / {f.input}: {f} °/V" for f in self.factored if f.gain]
        return "\n".join([*lines, *(f"Warning: {w}" for w in self.warnings)])

    def to_dataframe(self) -> DataFrame:
        """Return a data frame with a row per physical parameter, or for a black box, per pole.

        Raises UsageError if pandas is not installed.
        """
        pandas = optional("pandas")
        if self.found.parameters:
            rows = self.to_dict()["parameters"]
            return pandas.DataFrame.from_dict(rows, orient="index").rename_axis("parameter")
        return pandas.DataFrame([p.to_json() for p in self.poles]).rename_axis("pole")

    def to_dict(self, file: str | None = None) -> dict[str, Any]:
        """Return the model's entry in ``identify --json``; ``file`` is the saved model's path.

        An unknown value is None.
        """
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
            document["poles"] = [p.to_json() for p in self.poles]
        if self.found.transfer is not None:
            document["transfer_function"] = {
                **self.found.transfer.to_json(),
                "factored": [f.to_json() for f in self.factored],
            }
        document |= {
            **self.metrics.to_json(),
            "residual_tests": {t.name.replace(" ", "_"): t.to_json() for t in self.residuals},
            "feedback": asdict(self.feedback),
            "preparation": [r.to_json() for r in self.prepared.reports],
            "validation": self.prepared.split,
            "candidates": [c.to_json() for c in self.found.candidates],
            "notes": list(self.found.notes),
            "warnings": list(self.warnings),
        }
        plain: dict[str, Any] = jsonable(document)
        return plain


def _by_axis(score: Score) -> str:
    """Return the fit of each axis as text: ``roll 98.1 %, pitch 92.0 %, yaw 97.0 %``."""
    return ", ".join(f"{a} {f:.1f} %" for a, f in zip(AXES, score.fit_percent, strict=True))

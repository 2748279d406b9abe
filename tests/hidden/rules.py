"""The diagnosis' rules, one by one: in which flights each changes the answer, and what it is worth.

A rule is a function of `heli3dof.diagnosis` that can be left out: a cause that it would refuse
stays, an alternative that it would add is not added. `traced` runs a diagnosis and notes the rules
that changed anything in it. `without` runs a diagnosis without one rule. Both are used by
`tests.bench.bench_rules`: a rule that changes no answer, or makes as many wrong as right, can go.
"""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import OffNominal
from heli3dof.diagnosis.diagnose import diagnose  # with every module that uses a rule
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.search.steps import Step
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.recording.recording import Recording

Function = Callable[..., Any]
DIAGNOSIS = "heli3dof.diagnosis."
FIT = "heli3dof.identification.closed_loop_fit."


@dataclass(frozen=True)
class Rule:
    """A function of the diagnosis, and what stands in its place where it is left out."""

    name: str
    where: str
    """module:function"""
    left_out: Function
    """Called with the function itself and its arguments; returns the outcome without the rule"""

    @property
    def function(self) -> Function:
        module, name = self.where.split(":")
        return cast(Function, getattr(importlib.import_module(module), name))


def _argument(k: int) -> Function:
    """Leave out a rule that changes its argument number k: return it unchanged."""
    return lambda rule, *args, **_: args[k]


def _always(value: Any) -> Function:
    return lambda rule, *_, **__: value


RULES = (
    Rule(
        "an inertia that runs away is held",
        FIT + "base_fit:implausible_inertias",
        _always(()),
    ),
    Rule("the noise of a limit cycle is matched", FIT + "limit_cycle:matched_noise", _argument(2)),
    Rule("edge rates weigh in a limit cycle", FIT + "edge_rates:fit_with_edge_rates", _argument(1)),
    Rule(
        "effects without a slope are tried",
        DIAGNOSIS + "search.candidate_fits:trials",
        _always([]),
    ),
    Rule(
        "a weak further cause is refused",
        DIAGNOSIS + "search.select:best_choice",
        lambda rule, s, fits, first: rule(s, fits, None),
    ),
    Rule(
        "rivals are compared by their flights",
        DIAGNOSIS + "search.rivals:compared_by_simulation",
        _argument(0),
    ),
    Rule(
        "a cause must gain on held-out data",
        DIAGNOSIS + "conclusion.adoption:meets_adoption_condition",
        _always(True),
    ),
    Rule(
        "… and stand out of coloured noise",
        DIAGNOSIS + "conclusion.adoption:is_coloured_noise",
        _always(False),
    ),
    Rule(
        "… and exceed one count", DIAGNOSIS + "conclusion.adoption:within_a_count", _always(False)
    ),
    Rule(
        "full fits tie causes with an inertia",
        DIAGNOSIS + "conclusion.confounded_parameters:instead_of_inertia",
        _always([]),
    ),
    Rule(
        "… and exceed rounding in predictions (controller unknown)",
        DIAGNOSIS + "conclusion.adoption:exceeds_rounding",
        _always(True),
    ),
    Rule(
        "… and not act on an axis with a biased likelihood (controller unknown)",
        DIAGNOSIS + "conclusion.unknown_controller:is_biased",
        _always(False),
    ),
    Rule(
        "a formula competes with causes",
        DIAGNOSIS + "conclusion.compensating_causes:replaced_by_formula",
        _always(None),
    ),
    Rule(
        "pieces of the flight must agree",
        DIAGNOSIS + "conclusion.doubtful_findings:with_segment_ties",
        _argument(0),
    ),
    Rule(
        "doubtful findings are unconfirmed",
        DIAGNOSIS + "conclusion.doubtful_findings:marked_if_doubtful",
        _argument(0),
    ),
    Rule(
        "causes confounded with an inertia",
        DIAGNOSIS + "conclusion.confounded_parameters:with_confounded_causes",
        _argument(0),
    ),
    Rule(
        "encoder scales confounded with causes",
        DIAGNOSIS + "conclusion.confounded_encoder_scales:with_scale_ties",
        lambda rule, findings, off, *_, **__: (tuple(findings), tuple(off)),
    ),
    Rule(
        "model errors may bias base parameters",
        DIAGNOSIS + "base_parameters:std_inflation",
        _always(1.0),
    ),
    Rule(
        "free run: both halves must show it",
        DIAGNOSIS + "free_run.cause_selection:contradicted",
        _always(""),
    ),
    Rule(
        "free run: confounded causes",
        DIAGNOSIS + "free_run.elimination:with_confounded_terms",
        _argument(1),
    ),
    Rule(
        "free run: the size must be significant",
        DIAGNOSIS + "free_run.cause_selection:probability_nonzero",
        _always(1.0),
    ),
    Rule(
        "a search on a limit cycle also starts at the trim torque's ratio",
        FIT + "base_fit:start_scales",
        _always([1.0]),
    ),
    Rule(
        "a narrow prior of the inertias is about the trim torque's ratio",
        FIT + "base_fit:thrust_ratio",
        _always(1.0),
    ),
    Rule(
        "rivals that remain significant are confounded",
        DIAGNOSIS + "search.steps:with_rivals_that_remain",
        lambda rule, steps: list(steps),
    ),
    Rule(
        "the size limits the confidence",
        DIAGNOSIS + "conclusion.adoption:size_confidence",
        _always(1.0),
    ),
    Rule(
        "predictions confirm a formula (controller unknown)",
        DIAGNOSIS + "conclusion.compensating_causes:predictions_agree",
        _always(True),
    ),
    Rule(
        "flights refute the causes that a formula replaces (controller known)",
        DIAGNOSIS + "conclusion.compensating_causes:simulations_refute",
        _always(True),
    ),
    Rule(
        "… and lower the error of a plausible axis (controller unknown)",
        DIAGNOSIS + "conclusion.unknown_controller:unbiased_axes",
        _always(AXES),
    ),
    Rule(
        "base parameters off nominal must lower the error (controller unknown)",
        DIAGNOSIS + "conclusion.unknown_controller:confirmed",
        _argument(0),
    ),
    Rule(
        "a torque of time alone is slow noise",
        DIAGNOSIS + "unmodelled.unmodelled_torque:split_off_slow_noise",
        lambda rule, torques: (tuple(torques), ()),
    ),
    Rule(
        "correlated causes, inexact formulas and drift confound",
        DIAGNOSIS + "search.select:are_confounded",
        lambda rule, s, best, other: best.score - other.score < 6.0,
    ),
    Rule(
        "the noise floor contains coloured noise",
        DIAGNOSIS + "validation.simulation_error:coloured_variance",
        lambda rule, model, recordings, horizons_s, nulls: np.zeros((len(horizons_s), len(AXES))),
    ),
)
BY_NAME = {rule.name: rule for rule in RULES}


def outline(x: Any) -> Any:
    """Return what counts of a rule's outcome: names, alternatives, and numbers to six digits."""
    match x:
        case Choice():
            return (x.term.name, x.tied_with, outline(x.confidence))
        case Finding():
            return (outline(x.choice), x.unconfirmed)
        case Step():
            return outline(x.choice)
        case OffNominal():
            return (x.term.name, x.tied_with)
        case CorrectedFit():
            return (tuple(t.name for t in x.structure.terms), outline(x.optimum.theta))
        case ResidualTorque():
            return (x.axis, x.depends_on, x.resembles)
        case np.ndarray():
            return outline(x.tolist())
        case float():
            return float(f"{x:.6g}")
        case str() | int() | None:
            return x
        case tuple() | list():
            return tuple(map(outline, x))
        case dict():
            return tuple(map(outline, x.items()))
        case _:
            return x.term.name if hasattr(x, "term") else getattr(x, "name", type(x).__name__)


@contextmanager
def replaced(function: Function, by: Function) -> Iterator[None]:
    """Context manager: every module of the package that holds ``function`` holds ``by`` instead."""
    places = [
        (module, name)
        for key, module in list(sys.modules.items())
        if key.startswith("heli3dof")
        for name, value in list(vars(module).items())
        if value is function
    ]
    for module, name in places:
        setattr(module, name, by)
    try:
        yield
    finally:
        for module, name in places:
            setattr(module, name, function)


def noted(rule: Rule, changed: set[str]) -> Function:
    """Return the rule's function, which notes its name in ``changed`` where it changes anything."""
    function = rule.function

    def watched(*args: Any, **keywords: Any) -> Any:
        result = function(*args, **keywords)
        if outline(result) != outline(rule.left_out(function, *args, **keywords)):
            changed.add(rule.name)
        return result

    return watched


def traced(recording: Recording, holdout: Recording | None = None) -> dict[str, Any]:
    """Return the document of a diagnosis; its key ``rules`` lists the rules that changed anything.

    A rule may change a fit on the way without changing the answer.
    """
    changed: set[str] = set()
    with ExitStack() as stack:
        for rule in RULES:
            stack.enter_context(replaced(rule.function, noted(rule, changed)))
        document = _diagnosed(recording, holdout)
    return {**document, "rules": sorted(changed)}


def without(name: str, recording: Recording, holdout: Recording | None = None) -> dict[str, Any]:
    """Return the document of a diagnosis without the rule of that name."""
    rule = BY_NAME[name]
    with replaced(rule.function, partial(rule.left_out, rule.function)):
        return _diagnosed(recording, holdout)


def _diagnosed(recording: Recording, holdout: Recording | None) -> dict[str, Any]:
    # Through JSON text, as another program would read it.
    return dict(json.loads(json.dumps(diagnosis_document(diagnose(recording, holdout)))))

"""Write the top of the report: questions, each answered by a sentence and a picture.

A diagnosis answers how wrong the simulation was, what the cause is, what the extended model gains,
and what to do next. Without a diagnosis, a comparison answers how wrong the simulation was, which
model predicts best, and what to do next. Without both, an identification answers how well its model
predicts.
"""

from __future__ import annotations

import re

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.prediction import CONSTANT_ANGLES
from heli3dof.comparison.result import Comparison, FlightComparison, ModelComparison
from heli3dof.comparison.verdict import verdict
from heli3dof.experiment.plan import load_plan, named_plans
from heli3dof.identification.result import SUMMARY_HORIZON_S, Identification
from heli3dof.report.figures.comparison import comparison_figure
from heli3dof.report.figures.diagnosis import evidence_alt, evidence_figure
from heli3dof.report.figures.diagnosis_data import FigureData
from heli3dof.report.figures.flight import plan_figure
from heli3dof.report.figures.style import BLUE, GREEN, PURPLE, SKY, SOFT, VERMILION, model_lines
from heli3dof.report.pages.html import Answer, bars, figure
from heli3dof.report.text import diagnosis_sentences as words
from heli3dof.report.text import diagnosis_summary as summary
from heli3dof.report.text.comparison_sentences import model_sentence, prediction_sentence
from heli3dof.report.text.diagnosis_sentences import Document, number
from heli3dof.report.text.number_format import fixed

WRONG = "How wrong is the simulation?"
BEFORE_AFTER = {"before": VERMILION, "after": BLUE, "noise floor": SOFT}
PLAN_COMMAND = re.compile(r"heli3dof (?:run|simulate) (\S+)")
"""Pattern of a command that flies or simulates a plan, in a sentence on the next step"""


def diagnosis_answers(document: Document, data: FigureData, dt: float) -> list[Answer]:
    """Return the questions and answers at the top of a diagnosis' report.

    The questions are how wrong the simulation is, what the cause is, what the extended model gains
    and what to do next. ``data``: the data of the figures. ``dt``: control period in s.
    """
    answers = [_wrong(document), _cause(document, data), _gain(document), _next(document, dt)]
    return [a for a in answers if a is not None]


def _wrong(document: Document) -> Answer | None:
    sentence = " ".join(summary.simulation_error(document))
    if not sentence:
        return None
    groups = {
        axis: {
            "simulation error": number(e["rmse_deg"]),
            "noise floor": number(e["noise_floor_deg"]),
        }
        for axis, e in document["simulation_error"].items()
        if e["rmse_deg"] is not None
    }
    styles = {"simulation error": VERMILION, "noise floor": SOFT}
    seconds = next(iter(document["simulation_error"].values()))["horizon_s"]
    title = f"RMSE of {seconds:g} s predictions"
    return Answer(WRONG, sentence, bars(groups, styles, title, sentence))


def _cause(document: Document, data: FigureData) -> Answer:
    stated = [*summary.faults(document), *words.unmodelled_effects(document)]
    if causes := list(summary.causes(document)):
        stated = [" ".join(causes)]
    sentence = stated[0] if stated else words.verdict(document)
    seen = [*data.evidence, *data.residual_evidence]
    drawn = figure(evidence_figure(seen[0]), evidence_alt(seen[0])) if seen else ""
    return Answer("What is the cause, and how sure is it?", sentence, drawn)


def _gain(document: Document) -> Answer:
    question = "What does the extended model gain?"
    sentence = " ".join([*words.gain(document), *words.calibration_change(document)])
    if not sentence:
        return Answer(question, "Nothing: the diagnosis added no effect to the model.")
    gain = document["gain"] if words.adopted(document) else document["calibration_gain"]
    error = gain["holdout_rmse_deg"]
    groups = {
        axis: {
            name: number(error.get(name.replace(" ", "_"), {}).get(axis)) for name in BEFORE_AFTER
        }
        for axis in AXES
        if error["before"].get(axis) is not None
    }
    title = f"RMSE of {document['gain']['horizon_s']:g} s predictions"
    return Answer(question, sentence, bars(groups, BEFORE_AFTER, title, sentence))


def _next(document: Document, dt: float) -> Answer | None:
    """Return the first recommended action, with a picture of the plan that it names, if any."""
    for sentence in words.next_steps(document):
        command = PLAN_COMMAND.search(sentence)
        drawn = ""
        if command and (name := command[1].rstrip(".,;")) in named_plans():
            drawn = figure(plan_figure(load_plan(name), dt), f"References of the plan {name}")
        return Answer("What to do next?", sentence, drawn)
    return None


def comparison_answers(comparison: Comparison) -> list[Answer]:
    """Return the questions and answers at the top of a comparison's report.

    The questions are how wrong the simulation is, which model predicts best, and what to do next.
    The answers to the first two have pictures, which show the first recording. The function returns
    an empty list if no model was compared with the first recording.
    """
    flight = comparison.flights[0]
    if not flight.models:
        return []
    axis = worst_axis(flight, flight.models[0])
    drawn = figure(
        comparison_figure(flight, axis),
        f"{axis.capitalize()} of {flight.recording.name}, experiment and models",
        flight=flight.recording.digest,
    )
    name = flight.recording.name
    answers = [Answer(WRONG, f"{name}: {model_sentence(flight, flight.models[0])}", drawn)]
    answers += _best(comparison)
    step = "To find the cause of the error: heli3dof diagnose REC... --report FILE.html"
    return [*answers, Answer("What to do next?", step)]


def worst_axis(flight: FlightComparison, m: ModelComparison) -> str:
    """Return the axis on which the model's closed-loop simulation has the largest RMSE.

    If the closed loop was not simulated, the RMSE of the model's predictions is used. If there are
    no predictions either, the result is the first measured axis.
    """
    errors = m.replay_rmse_deg
    if errors is None or not np.isfinite(errors).any():
        errors = None if m.prediction is None else m.prediction.over_window_deg
    if errors is None or not np.isfinite(errors).any():
        return flight.recording.axes[0]
    return AXES[int(np.nanargmax(errors))]


def _best(comparison: Comparison) -> list[Answer]:
    """Return a list with the answer to "Which model predicts best?"; [] without predictions."""
    flight = comparison.flights[0]
    alt = prediction_sentence(flight)
    if not alt:
        return []
    groups = {
        axis: {
            name: float(p.over_window_deg[AXES.index(axis)])
            for name, p in flight.predictions.items()
            if p is not None
        }
        for axis in flight.flown.axes
    }
    lines = model_lines([m.kind for m in flight.models])
    styles = {m.name: line.color for m, line in zip(flight.models, lines, strict=True)}
    title = f"RMSE of predictions in {flight.recording.name}"
    if flight.constant_angles is not None:
        title += f", over {flight.constant_angles.window_s:g} s"
    drawn = bars(groups, {**styles, CONSTANT_ANGLES: SOFT}, title, alt)
    return [Answer("Which model predicts best?", " ".join(verdict(comparison)), drawn)]


def identification_answer(found: Identification) -> Answer:
    """Return the report's answer from an identification: the model's fit (%) to held-out data."""
    ahead = found.metrics.prediction[SUMMARY_HORIZON_S].fit_percent
    each = [f"{axis} {fixed(float(ahead[i]), 1, ' %')}" for i, axis in enumerate(AXES)]
    sentence = f"Fit {SUMMARY_HORIZON_S:g} s ahead on held-out data: {', '.join(each)}."
    rmse = {f"RMSE {h:g} s ahead": s.rmse for h, s in found.metrics.prediction.items() if h > 0}
    groups = {
        axis: {name: float(np.degrees(errors[i])) for name, errors in rmse.items()}
        for i, axis in enumerate(AXES)
    }
    styles = dict(zip(rmse, (SKY, BLUE, GREEN, PURPLE), strict=False))
    return Answer(
        f"How well does {found.model.name} predict?",
        sentence,
        bars(groups, styles, "RMSE of predictions", sentence),
    )

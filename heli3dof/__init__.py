"""heli3dof: from a 3-DOF helicopter on the bench to a model that can be trusted.

Everything the command line does can be done from Python::

    import heli3dof as h3

    flight = h3.fly_plan(h3.load_plan("multisine"), device="mock:?speed=max&seed=1")
    found = h3.identify(flight.recording)
    table = h3.compare([h3.load("step.mcap")], [h3.hover_model(h3.default_profile()), found.model])
    wrong = h3.diagnosis_document(h3.diagnose(flight.recording))

Arrays are SI (s, V, rad) with columns (roll, pitch, yaw) and (front, back). Errors are those of
`heli3dof.errors`. A name is imported when it is first used, so that importing the package costs
nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from heli3dof.comparison.compare import Comparison, compare
    from heli3dof.comparison.document import to_json as comparison_document
    from heli3dof.comparison.metrics import flight_metrics
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.diagnosis.document import document as diagnosis_document
    from heli3dof.diagnosis.result import Diagnosis
    from heli3dof.experiment.fly import Flight, fly_plan
    from heli3dof.experiment.plan import Plan, load_plan, plan_from_dict, step_plan
    from heli3dof.experiment.simulate import simulate
    from heli3dof.identification.identify import Identification, identify
    from heli3dof.model.control.controller import Controller
    from heli3dof.model.control.stability import check_loop
    from heli3dof.model.linear.hover import hover_model
    from heli3dof.model.linear.model import LinearModel
    from heli3dof.model.model_file import save_model
    from heli3dof.paper.models import load_model
    from heli3dof.recording.info import file_info
    from heli3dof.recording.load import load
    from heli3dof.recording.logs.export import export
    from heli3dof.recording.logs.import_log import import_log
    from heli3dof.recording.mcap_files.reader import read_recording
    from heli3dof.recording.mcap_files.recover import recover
    from heli3dof.recording.recording import Recording, make_recording
    from heli3dof.recording.write import write_recording
    from heli3dof.report.figures import comparison_figures, flight_figure
    from heli3dof.report.flight_report import flight_report
    from heli3dof.rig.drivers import find_rigs, open_rig
    from heli3dof.rig.profile import Profile, default_profile, load_profile, profile_from_dict

_HOME = {
    "Comparison": "comparison.compare",
    "Controller": "model.control.controller",
    "Diagnosis": "diagnosis.result",
    "Flight": "experiment.fly",
    "Identification": "identification.identify",
    "LinearModel": "model.linear.model",
    "Plan": "experiment.plan",
    "Profile": "rig.profile",
    "Recording": "recording.recording",
    "check_loop": "model.control.stability",
    "compare": "comparison.compare",
    "comparison_document": "comparison.document:to_json",
    "comparison_figures": "report.figures",
    "default_profile": "rig.profile",
    "diagnose": "diagnosis.diagnose",
    "diagnosis_document": "diagnosis.document:document",
    "export": "recording.logs.export",
    "file_info": "recording.info",
    "find_rigs": "rig.drivers",
    "flight_figure": "report.figures",
    "flight_metrics": "comparison.metrics",
    "flight_report": "report.flight_report",
    "fly_plan": "experiment.fly",
    "hover_model": "model.linear.hover",
    "identify": "identification.identify",
    "import_log": "recording.logs.import_log",
    "load": "recording.load",
    "load_model": "paper.models",
    "load_plan": "experiment.plan",
    "load_profile": "rig.profile",
    "make_recording": "recording.recording",
    "open_rig": "rig.drivers",
    "plan_from_dict": "experiment.plan",
    "profile_from_dict": "rig.profile",
    "read_recording": "recording.mcap_files.reader",
    "recover": "recording.mcap_files.recover",
    "save_model": "model.model_file",
    "simulate": "experiment.simulate",
    "step_plan": "experiment.plan",
    "write_recording": "recording.write",
}
"""Public name → the module it lives in (and its name there, where that differs)."""

__all__ = [
    "Comparison",
    "Controller",
    "Diagnosis",
    "Flight",
    "Identification",
    "LinearModel",
    "Plan",
    "Profile",
    "Recording",
    "check_loop",
    "compare",
    "comparison_document",
    "comparison_figures",
    "default_profile",
    "diagnose",
    "diagnosis_document",
    "export",
    "file_info",
    "find_rigs",
    "flight_figure",
    "flight_metrics",
    "flight_report",
    "fly_plan",
    "hover_model",
    "identify",
    "import_log",
    "load",
    "load_model",
    "load_plan",
    "load_profile",
    "make_recording",
    "open_rig",
    "plan_from_dict",
    "profile_from_dict",
    "read_recording",
    "recover",
    "save_model",
    "simulate",
    "step_plan",
    "write_recording",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'heli3dof' has no attribute {name!r}")
    module, _, there = _HOME[name].partition(":")
    return getattr(importlib.import_module(f"heli3dof.{module}"), there or name)


def __dir__() -> list[str]:
    return list(__all__)

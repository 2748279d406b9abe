from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from .comparison.compare import Comparison as Comparison
from .comparison.compare import compare as _public_compare
from .comparison.document import comparison_document as comparison_document
from .comparison.metrics import AxisMetrics
from .comparison.metrics import flight_metrics as _public_flight_metrics
from .diagnosis.diagnose import diagnose as _public_diagnose
from .diagnosis.document import diagnosis_document as diagnosis_document
from .diagnosis.planning.next_experiment import next_experiment as next_experiment
from .diagnosis.planning.run_auto import AutoResult as AutoResult
from .diagnosis.planning.run_auto import Fly, Message
from .diagnosis.planning.run_auto import run_auto as _public_run_auto
from .diagnosis.result import Diagnosis as Diagnosis
from .diagnosis.result import NextExperiment as NextExperiment
from .errors import CheckFailed as CheckFailed
from .errors import DeviceError as DeviceError
from .errors import Heli3dofError as Heli3dofError
from .errors import NoSpace as NoSpace
from .errors import OutputExists as OutputExists
from .errors import PlanError as PlanError
from .errors import ProfileError as ProfileError
from .errors import RecordingError as RecordingError
from .errors import SafetyTrip as SafetyTrip
from .errors import UnstableLoop as UnstableLoop
from .errors import UsageError as UsageError
from .experiment.control_loop.loop import Live
from .experiment.doctor import DoctorReport as DoctorReport
from .experiment.doctor import doctor as _public_doctor
from .experiment.fly import Flight as Flight
from .experiment.fly import fly_plan as _public_fly_plan
from .experiment.plan import Plan as Plan
from .experiment.plan import load_plan as load_plan
from .experiment.plan import named_plans as named_plans
from .experiment.plan import plan_from_dict as plan_from_dict
from .experiment.plan import step_plan as step_plan
from .experiment.simulate import Start
from .experiment.simulate import simulate as _public_simulate
from .identification.identify import Identification as Identification
from .identification.identify import identify as _public_identify
from .model.base import Model
from .model.control.controller import Controller as Controller
from .model.control.stability import check_loop as _public_check_loop
from .model.effects import effects as effects
from .model.effects.base import Effect as Effect
from .model.export import export as export
from .model.greybox.model import GreyBoxModel as GreyBoxModel
from .model.linear.hover import hover_model as _public_hover_model
from .model.linear.model import LinearModel as LinearModel
from .model.model_file import save_model as _public_save_model
from .paper.models import load_model as _public_load_model
from .paper.reproduction import Reproduced
from .recording.info import file_info as _public_file_info
from .recording.load import load as _public_load
from .recording.logs.from_arrays import make_recording as _public_make_recording
from .recording.logs.import_log import import_log as _public_import_log
from .recording.mcap_files.reader import read_recording as _public_read_recording
from .recording.mcap_files.recover import recover as recover
from .recording.recording import Recording as Recording
from .recording.save_profile import save_profile as _public_save_profile
from .recording.write import write_recording as _public_write_recording
from .report.figures.comparison import comparison_figures as comparison_figures
from .report.figures.flight import flight_figure as _public_flight_figure
from .report.pages.flight_report import Diagnosed
from .report.pages.flight_report import flight_report as _public_flight_report
from .report.text.diagnosis_summary import diagnosis_summary as diagnosis_summary
from .rig.drivers import find_rigs as find_rigs
from .rig.interface import Check, Identity
from .rig.interface import Command as Command
from .rig.interface import Sample as Sample
from .rig.profile import ControllerSpec
from .rig.profile import Profile as Profile
from .rig.profile import default_profile as default_profile
from .rig.profile import load_profile as load_profile
from .rig.profile import profile_from_dict as profile_from_dict
from .rig.session.estop import EstopResult as EstopResult
from .rig.session.estop import estop as estop
from .rig.session.open_exclusive import open_rig as _public_open_rig
from .rig.session.stoppable_rig import StoppableRig
from .rig.zero import ZeroResult as ZeroResult
from .rig.zero import zero as _public_zero
from .stage_clock import Progress

__version__: str

def compare(
    recordings: Recording | str | Path | Sequence[Recording | str | Path],
    models: Model
    | str
    | Path
    | Sequence[Model | str | Path]
    | Callable[[Recording], Sequence[Model]],
    *,
    horizons_s: float | Sequence[float] = ...,
    identify_controller: bool = ...,
) -> Comparison:
    """Return the comparison of every model with every recording."""

def flight_metrics(recording: Recording | str | Path) -> Mapping[str, AxisMetrics]:
    """Return {axis: step metrics of the measured angle} of a recording."""

def diagnose(
    recordings: Recording | str | Path | Sequence[Recording | str | Path],
    holdout: Recording | str | Path | Sequence[Recording | str | Path] | None = ...,
    *,
    quick: bool = ...,
    seed: int = ...,
    progress: Progress = ...,
    base: str = ...,
) -> Diagnosis:
    """Return how well a simulation predicts these recordings, and the causes of its errors."""

def run_auto(
    first: Plan | str | Path = ...,
    *,
    device: str,
    profile: Profile | str | Path | None = ...,
    folder: str | Path,
    budget_min: float = ...,
    quick: bool = ...,
    seed: int = ...,
    fly: Fly | None = ...,
    diagnosing: Callable[[], AbstractContextManager[Message]] = ...,
    each: Message = ...,
) -> AutoResult:
    """Fly and diagnose until no further flight is recommended, or the budget is spent."""

def doctor(
    device: str | None = ...,
    profile: Profile | str | Path | None = ...,
    *,
    folder: str | Path = ...,
    arm: bool = ...,
    each: Callable[[Check], None] = ...,
) -> DoctorReport:
    """Run every check and return the report; call ``each`` with each check when it is done."""

def fly_plan(
    plan: Plan | str | Path,
    *,
    device: str = ...,
    profile: Profile | str | Path | None = ...,
    seed: int = ...,
    output: str | Path | None = ...,
    force: bool = ...,
    meta: Mapping[str, Any] | None = ...,
    live: Live | None = ...,
    opened: Callable[[Identity], None] = ...,
    warn: Callable[[str], None] = ...,
) -> Flight:
    """Fly a plan on a rig and record it (to the file ``output``, or in memory)."""

def simulate(
    plan: Plan | str | Path,
    model: Model | str | Path,
    *,
    profile: Profile | str | Path | None = ...,
    seed: int = ...,
    start: Start = ...,
    quantised: bool = ...,
) -> Recording:
    """Fly a plan in closed loop on a model and return the recording."""

def identify(
    recordings: Recording | str | Path | Sequence[Recording | str | Path],
    *,
    method: str = ...,
    order: int | None = ...,
    terms: str | Sequence[str] | None = ...,
    holdout: Recording | str | Path | Sequence[Recording | str | Path] | None = ...,
    intervals_s: float | Sequence[float] = ...,
    name: str | None = ...,
    progress: Progress = ...,
) -> Identification:
    """Return a model identified from recordings of one rig."""

def check_loop(
    model: Model | str | Path, controller: ControllerSpec | None, dt: float
) -> np.ndarray:
    """Return `Model.loop_poles` (rad/s, rightmost first); raise UnstableLoop if one is unstable."""

def hover_model(
    profile: Profile | str | Path, *, printed: bool = ..., dt: float | None = ...
) -> LinearModel:
    """Return the hover model, sampled at the control rate (or every ``dt`` s) with zero-order hold."""

def save_model(model: Model | str | Path, path: str | Path, *, force: bool = ...) -> Path:
    """Write the model's file atomically and return its path."""

def load_model(name_or_path: str | Path, profile: Profile | str | Path | None = ...) -> Model:
    """Return a built-in model for a rig's profile, or the model in a file."""

def file_info(
    path: str | Path,
    profile: Profile | str | Path | None = ...,
    columns: str | Sequence[str] | None = ...,
) -> dict[str, Any]:
    """Return the `summary` of the recording in a file, and the file's name and size in bytes."""

def load(
    path: str | Path,
    profile: Profile | str | Path | None = ...,
    columns: str | Sequence[str] | None = ...,
) -> Recording:
    """Read a `Recording` from an MCAP file or from a log (`importers`): CSV, MAT, …"""

def make_recording(
    t: ArrayLike,
    voltage: ArrayLike,
    angle: ArrayLike,
    profile: Profile | str | Path,
    *,
    reference: ArrayLike | None = ...,
    voltage_cmd: ArrayLike | None = ...,
    voltage_extra: ArrayLike | None = ...,
    channels: Mapping[str, np.ndarray] | None = ...,
    meta: Mapping[str, Any] | None = ...,
) -> Recording:
    """Return a `Recording` made of arrays, checked like an imported log (`recording_from_table`)."""

def import_log(
    paths: str | Path | Sequence[str | Path],
    profile: Profile | str | Path | None,
    columns: str | Sequence[str] | None = ...,
    *,
    mapping: Mapping[str, str] | None = ...,
    rate_hz: float | None = ...,
    check_values: bool = ...,
) -> Recording:
    """Read another program's log (CSV, gzipped CSV, MAT, MCAP) as a `Recording`."""

def read_recording(path: str | Path, profile: Profile | str | Path | None = ...) -> Recording:
    """Return the recording in an MCAP file, which heli3dof or another program has written."""

def save_profile(profile: Profile | str | Path, path: str | Path, *, force: bool = ...) -> Path:
    """Write a profile to the TOML file ``path`` and return the path."""

def write_recording(
    recording: Recording | str | Path, path: str | Path, *, force: bool = ...
) -> Path:
    """Write a recording to the MCAP file ``path`` and return the path."""

def flight_figure(recording: Recording | str | Path) -> Figure:
    """Draw a recording over time: angles and references in degrees, both motor voltages in V."""

def flight_report(
    recordings: Recording | str | Path | Sequence[Recording | str | Path],
    *,
    models: Model
    | str
    | Path
    | Sequence[Model | str | Path]
    | Callable[[Recording], Sequence[Model]] = ...,
    comparison: Comparison | None = ...,
    identified: Identification | Sequence[Identification] = ...,
    diagnosed: Diagnosis | Diagnosed | None = ...,
    reproduced: Sequence[Reproduced] = ...,
    title: str = ...,
) -> str:
    """Return the report of ``recordings`` as an HTML document."""

@contextmanager
def open_rig(
    device: str,
    profile: Profile | str | Path,
    *,
    doing: str | None = ...,
    also: Callable[[], Mapping[str, Any]] = ...,
    began_ns: int | None = ...,
) -> Iterator[StoppableRig]:
    """Context manager: open and lock the rig; close it, with the motors at zero, at the end."""

def zero(
    device: str | None = ...,
    profile: Profile | str | Path | None = ...,
    *,
    angles_deg: tuple[float | None, float | None, float | None] = ...,
    store: bool = ...,
) -> ZeroResult:
    """Measure the encoder counts of a rig at rest and store them. Moves nothing."""

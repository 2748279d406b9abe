"""What comes out on two real rigs; also writes the tables of docs/real-data.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import heli3dof as h3
from heli3dof.comparison.shares import error_deg, shares
from heli3dof.identification.greybox.freeflight import free_rows
from heli3dof.model.greybox import GreyBoxModel
from heli3dof.report.grid import to_markdown
from heli3dof.report.identification_section import parameters_table
from heli3dof.report.tables import prediction_table
from tests.bench import Figure
from tests.paths import REAL_DATA, ROOT

TITLE = "Real recordings"
INTRO = """
Free prediction of recordings that no fit has seen, RMSE over all samples up to 3 s after the
states were last re-estimated. Tables and words are in [real-data.md](real-data.md). Measured
only where the recordings are.
"""
PAGE = ROOT / "docs" / "real-data.md"
BEGIN, END = "<!-- begin {} -->", "<!-- end {} -->"


@dataclass(frozen=True)
class Trial:
    """Recordings of one rig: what is fitted and what is kept back."""

    rig: str
    train: Sequence[str]
    test: Sequence[str]

    def load(self, name: str) -> h3.Recording:
        return h3.load(REAL_DATA / self.rig / f"{name}.csv", self.profile)

    @property
    def profile(self) -> h3.Profile:
        return h3.load_profile(REAL_DATA / self.rig / "profile.toml")


TRIALS = (
    Trial("rig-a", ("closed-1a", "closed-2a"), ("closed-1b",)),
    Trial("rig-b", ("closed-03", "closed-05", "closed-08"), ("closed-09", "closed-13")),
)


def measure() -> list[Figure]:
    if not REAL_DATA.is_dir():
        return []
    figures, blocks = [], {}
    for trial in TRIALS:
        train = [trial.load(n) for n in trial.train]
        test = [trial.load(n) for n in trial.test]
        found = [
            h3.identify(train, holdout=test, method=method, name=name)
            for method, name in (("pem", "black box"), ("greybox", "grey box"))
        ]
        models = [h3.hover_model(trial.profile), *(f.model for f in found)]
        compared = h3.compare(test, models)
        tables = [to_markdown(t) for f in compared.flights if (t := prediction_table(f))]
        tables.append(to_markdown(parameters_table(found[-1])))
        said = [s.replace("\n", " ") for s in found[0].sentences()]
        said += [f"Grey box: {w}" for w in found[-1].warnings]
        blocks[trial.rig] = "\n".join([*(f"- {s}" for s in dict.fromkeys(said)), "", *tables])
        for flight in compared.flights:
            for model in flight.models:
                assert model.prediction is not None
                rmse = model.prediction.over_window_deg
                figures.append(
                    Figure(
                        f"{trial.rig}, {flight.recording.name}: {model.name}, over 3 s",
                        " / ".join(f"{e:.2f}" for e in rmse) + " °",
                        how=f"roll / pitch / yaw; fitted on {', '.join(trial.train)}"
                        if model.name != "hover"
                        else "roll / pitch / yaw; the profile's nominal values",
                    )
                )
        if isinstance(grey := found[-1].model, GreyBoxModel) and grey.varying:
            figures += fitted_to_flights(trial, grey, test)
    write_page(PAGE, blocks)
    return figures


def fitted_to_flights(
    trial: Trial, model: GreyBoxModel, test: Sequence[h3.Recording]
) -> list[Figure]:
    """The same error from the end of the climb on, and each term's share of the whole error."""
    free = [r.rows(slice(int(np.flatnonzero(free_rows(r))[0]), None)) for r in test]
    figures = [
        Figure(
            f"{trial.rig}: grey box, over 3 s, from the end of the climb on",
            _deg(error_deg(model, free, 3.0)),
            how="roll / pitch / yaw; what a take-off does to a clock no model holds",
        )
    ]
    return figures + [
        Figure(
            f"{trial.rig}: grey box without {s.term}",
            _deg(s.without_deg),
            how=f"not refitted, from the end of the climb on; with it {_deg(s.whole_deg)}",
        )
        for s in shares(model, free)
    ]


def _deg(rmse: np.ndarray) -> str:
    return " / ".join(f"{e:.2f}" for e in rmse) + " °"


def write_page(page: Path, blocks: dict[str, str]) -> None:
    """Replace what stands between the markers of each block."""
    text = page.read_text(encoding="utf-8")
    for name, block in blocks.items():
        begin, end = BEGIN.format(name), END.format(name)
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = f"{before}{begin}\n\n{block.strip()}\n\n{end}{after}"
    page.write_text(text, encoding="utf-8")

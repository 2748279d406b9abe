"""What comes out on two real rigs; also writes the tables of docs/real-data.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import heli3dof as h3
from heli3dof.report.grid import to_markdown
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
        found = h3.identify(train, holdout=test, name="identification")
        compared = h3.compare(test, [h3.hover_model(trial.profile), found.model])
        tables = [to_markdown(t) for f in compared.flights if (t := prediction_table(f))]
        said = [s.replace("\n", " ") for s in found.sentences()]
        blocks[trial.rig] = "\n".join([*(f"- {s}" for s in said), "", *tables])
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
    write_page(PAGE, blocks)
    return figures


def write_page(page: Path, blocks: dict[str, str]) -> None:
    """Replace what stands between the markers of each block."""
    text = page.read_text(encoding="utf-8")
    for name, block in blocks.items():
        begin, end = BEGIN.format(name), END.format(name)
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = f"{before}{begin}\n\n{block.strip()}\n\n{end}{after}"
    page.write_text(text, encoding="utf-8")

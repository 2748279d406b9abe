"""Write the HTML page of a diagnosis: the diagnosis, its flights and their provenance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from heli3dof.diagnosis.result import Diagnosis
from heli3dof.recording.recording import Recording
from heli3dof.report.figures.diagnosis_data import figure_data
from heli3dof.report.pages.flight_report import Diagnosed, flight_report


def diagnosis_page(
    found: Diagnosis,
    document: dict[str, Any],
    recordings: Sequence[Recording],
    holdout: Sequence[Recording] = (),
    *,
    title: str = "",
) -> str:
    """Return the HTML page of the diagnosis ``found``.

    ``document``: its ``diagnose --json`` document; ``recordings``, ``holdout``: the recordings that
    were fitted and held out. The default title names ``recordings``.
    """
    diagnosed = Diagnosed(document, figure_data(found, recordings, holdout))
    names = ", ".join(r.name for r in recordings)
    return flight_report(
        [*recordings, *holdout], diagnosed=diagnosed, title=title or f"Diagnosis: {names}"
    )

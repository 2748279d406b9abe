"""The numbers in section III and Table II of the paper, and why each can be reproduced or not.

Each column of Table II has a model's name, but contains the *difference* of that model from the
experiment (erratum E11). The table's "overshoot" is a peak value (E10).

No number that involves the experiment or the identified model can be reproduced. The experiment's
recording was never published: its sample rate, its start and the identified model's fit to it are
unknown (E15). The identified model is eq (17). With the gain K_g it is unstable in closed loop,
whether eq (17) is read as printed or as corrected (E14).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Subject = Literal["experiment", "hover", "identification"]
Quantity = Literal["peak", "error", "peak_difference", "error_difference"]

NO_EXPERIMENT = "the experiment's recording was never published (E15)"
NO_IDENTIFICATION = "eq (17) is misprinted and unstable in the loop with K_g in every reading (E14)"
BY_SYMMETRY = "zero by symmetry: a roll step drives only V_F + V_B (E13)"
HOVER_ROLL = "eqs (7)–(14) with errata E3–E6 corrected, 10° step, K_g"


@dataclass(frozen=True)
class Published:
    """One number (degrees) that the paper prints, and why it can be reproduced or not.

    ``where`` names the figure or table in the paper.
    """

    axis: str
    subject: Subject
    """Experiment or model that the number describes; for a difference, the model"""
    quantity: Quantity
    value_deg: float
    where: str
    reproducible: bool
    why: str


def _differences() -> tuple[Published, ...]:
    rows: tuple[tuple[str, tuple[float, float, float, float]], ...] = (
        ("roll", (11, 1, 0, 1)),
        ("pitch", (13, 8, 2, 1)),
        ("yaw", (23, 3, 7, 0)),
    )
    columns: tuple[tuple[Subject, Quantity], ...] = (
        ("hover", "peak_difference"),
        ("identification", "peak_difference"),
        ("hover", "error_difference"),
        ("identification", "error_difference"),
    )
    return tuple(
        Published(axis, subject, quantity, value, "Table II", False, NO_EXPERIMENT)
        for axis, values in rows
        for (subject, quantity), value in zip(columns, values, strict=True)
    )


TABLE_II: tuple[Published, ...] = _differences()
"""Table II as printed: twelve differences between a model and the experiment, in degrees."""

TEXT: tuple[Published, ...] = (
    Published("roll", "experiment", "peak", 23, "Fig 7", False, NO_EXPERIMENT),
    Published("roll", "identification", "peak", 22, "Fig 7", False, NO_IDENTIFICATION),
    Published("roll", "hover", "peak", 12, "Fig 7", True, HOVER_ROLL),
    Published("roll", "hover", "error", 0, "Fig 7", True, HOVER_ROLL),
    Published("pitch", "identification", "error", 3, "Fig 8", False, NO_IDENTIFICATION),
    Published("pitch", "hover", "peak", 0, "Fig 8 (1e-15)", True, BY_SYMMETRY),
    Published("pitch", "hover", "error", 0, "Fig 8", True, BY_SYMMETRY),
    Published("yaw", "experiment", "peak", 23, "Fig 9", False, NO_EXPERIMENT),
    Published("yaw", "experiment", "error", 7, "Fig 9", False, NO_EXPERIMENT),
    Published("yaw", "identification", "peak", 20, "Fig 9", False, NO_IDENTIFICATION),
    Published("yaw", "identification", "error", 7, "Fig 9", False, NO_IDENTIFICATION),
    Published("yaw", "hover", "peak", 0, "Fig 9", True, BY_SYMMETRY),
    Published("yaw", "hover", "error", 0, "Fig 9", True, BY_SYMMETRY),
)
"""The numbers in the paper's text: peaks and errors of the experiment and of both models."""

CAVEATS: tuple[str, ...] = (
    "Table II's columns are headed with a model's name but hold its difference from the "
    "experiment (E11).",
    "What the paper calls overshoot there is the peak value; its own definition is the largest "
    "difference from the set value (E10). Both are shown.",
    "The abstract gives 1°, 3°, 8° in roll, pitch, yaw; Table II says 1, 8, 3 (E12).",
    "The identified model was judged on the recording that made it; no held-out flight, sample "
    "rate or fit is given (E15).",
    "Two explanations of the experiment's 23° are possible, neither proven: a start from rest "
    "at −27.5° with rotor lag, or a 20° yaw command that the hover run did not have.",
)
"""Notes that accompany the published table wherever it is shown."""


def published(axis: str, subject: Subject, quantity: Quantity) -> Published | None:
    """Return the number that the paper prints for one axis; None if it prints none.

    ``subject``: the experiment or a model; ``quantity``: for example the peak of the angle.
    """
    for number in (*TEXT, *TABLE_II):
        if (number.axis, number.subject, number.quantity) == (axis, subject, quantity):
            return number
    return None

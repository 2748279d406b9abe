"""Every page with computed blocks."""

from __future__ import annotations

from tests.bench.page import STUDIES
from tests.pages import (
    comparison_page,
    effects_page,
    exercise_page,
    fleet_page,
    integrity_page,
    mock_page,
    paper_page,
    plans_page,
    profile_page,
    protocol_page,
    scale_page,
)
from tests.safety import table as safety_page

PAGES = [
    *STUDIES,
    safety_page.RAMP_DOWN_PAGE,
    protocol_page.GOLDEN_PAGE,
    fleet_page.RESULTS_PAGE,
    *(
        module.PAGE
        for module in (
            comparison_page,
            effects_page,
            exercise_page,
            fleet_page,
            integrity_page,
            mock_page,
            paper_page,
            plans_page,
            profile_page,
            protocol_page,
            safety_page,
            scale_page,
        )
    ),
]

"""Write the section of the HTML report on an identification."""

from __future__ import annotations

import numpy as np

from heli3dof.identification.result import Identification
from heli3dof.identification.validation import WARM_UP_S
from heli3dof.report.figures.models import bode_with_bands, residual_figure
from heli3dof.report.pages.html import Section, figure, paragraph, table, warning
from heli3dof.report.text.identification_tables import (
    candidates_table,
    fits_table,
    identification_tables,
)


def identification_section(found: Identification) -> Section:
    """Return an identification as a section of an HTML report."""
    blocks = [warning(w) for w in found.warnings]
    bode = bode_with_bands(found)
    if bode is not None:
        blocks.append(figure(bode, "Bode diagrams with bands of two standard deviations"))
    fits = fits_table(found)
    blocks.append(table(fits))
    details = [paragraph(s) for s in found.sentences() if not s.startswith("Warning: ")]
    details += [table(g) for g in identification_tables(found) if g.title != fits.title]
    if found.found.candidates:
        details.append(table(candidates_table(found)))
    errors, _ = found.found.innovations(found.prepared, found.prepared.held_out)
    if errors:
        e = max(errors, key=len)
        interval_s = found.found.test_interval_s or found.interval_s
        settled = round(WARM_UP_S / interval_s)  # until the filter has converged
        e = e[settled:] if len(e) > 2 * settled else e
        t = np.arange(len(e)) * interval_s
        drawn = residual_figure(t, e)
        details.append(figure(drawn, "Innovations and their autocorrelation"))
    return Section(f"Identification: {found.model.name}", blocks, details)

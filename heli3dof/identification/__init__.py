"""Models from recordings: prepare, test for feedback, fit, choose, validate.

Public names: `identify` and what it returns, `Identification`; `prepare` and `Prepared` for those
who want the data themselves; `METHODS`. identification.md says what was chosen and why.
"""

from heli3dof.identification.feedback import Feedback, feedback_test
from heli3dof.identification.identify import identify
from heli3dof.identification.methods import METHODS
from heli3dof.identification.preprocessing import Prepared, prepare
from heli3dof.identification.result import Identification

__all__ = [
    "METHODS",
    "Feedback",
    "Identification",
    "Prepared",
    "feedback_test",
    "identify",
    "prepare",
]

"""What a diagnosis names is not listed among the effects that the recordings cannot show."""

from __future__ import annotations

from typing import Any, cast

from heli3dof.diagnosis.base_parameters import OffNominal
from heli3dof.diagnosis.conclusion.conclude import without_causes
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.selection.select import Choice
from heli3dof.model.effects import term


def test_a_named_cause_is_identifiable() -> None:
    none = cast(Any, None)
    drag = Choice(term("drag.quadratic.roll"), 1144.0, 175.0, 1.0, ("friction.viscous.roll",), ())
    causes = [
        Finding(drag, {}, none, none), OffNominal(term("inertia.pitch"), 1.4, 0.05, 64.0),
    ]  # fmt: skip
    names = ["drag.quadratic.roll", "friction.viscous.roll", "inertia.pitch", "encoder.scale.yaw"]
    assert without_causes(names, causes) == ("friction.viscous.roll", "encoder.scale.yaw")

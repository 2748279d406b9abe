"""The table of an identification's parameters."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from heli3dof.identification.fit_result import Parameter
from heli3dof.report.text.identification_tables import parameters_table


def found(**parameters: Parameter) -> Any:
    names = {name.replace("__", "."): p for name, p in parameters.items()}
    return SimpleNamespace(found=SimpleNamespace(parameters=names, correlation=None))


def test_the_summary_shows_all_parameters_of_a_significant_effect() -> None:
    def parameter(value: float, nominal: float, unit: str) -> Parameter:
        return Parameter(value, 0.01, unit, nominal=nominal)

    table = parameters_table(
        found(
            friction__stribeck__pitch__torque_Nm=parameter(0.2, 0.0, "N·m"),
            # The value without the effect is the shape's usual one.
            friction__stribeck__pitch__rate_rad_per_s=parameter(0.1, 0.1, "rad/s"),
            disturbance__periodic__yaw__torque_Nm=parameter(0.0, 0.0, "N·m"),
            disturbance__periodic__yaw__frequency_Hz=parameter(3.0, 1.0, "Hz"),
            motor__lag__time_constant_s=parameter(0.1, 0.0, "s"),
        ),
        brief=True,
    )
    assert [row[0] for row in table.rows] == [
        "friction.stribeck.pitch.torque", "friction.stribeck.pitch.rate", "motor.lag",
    ]  # fmt: skip
    assert table.notes == ["Not significant: disturbance.periodic.yaw."]

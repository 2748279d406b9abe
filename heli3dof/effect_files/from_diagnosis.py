"""Write the formula of an unmodelled torque as an effect: a small package, ready for pip install.

The source is the JSON document of a diagnosis (``leftover``) or an extended model
(`heli3dof.model.effects.empirical`). A model's coefficients are relative to its profile's thrust
gain; `ThrustScale` converts them to SI, as in the diagnosis. The package contains the effect with
its equation, units and bounds, a test, and the entry point that registers it.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError
from heli3dof.file_kind import no_file
from heli3dof.identification.greybox.thrust_scale import thrust_scale
from heli3dof.model.effects.empirical import PREFIX, factors, unit_of_product
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.model_file import read_model
from heli3dof.model.parameter_units import torque_per

CODE = {
    "roll": "s[R]", "pitch": "s[P]", "yaw": "s[PSI]", "roll_rate": "s[R_DOT]",
    "pitch_rate": "s[P_DOT]", "yaw_rate": "s[PSI_DOT]", "voltage_front": "s[V_FRONT]",
    "voltage_back": "s[V_BACK]", "voltage_sum": "(s[V_FRONT] + s[V_BACK])",
    "voltage_difference": "(s[V_FRONT] - s[V_BACK])",
}  # fmt: skip
"""Quantity → Python expression of the context array s (`model.physics.state_layout`)"""
EXAMPLE = {"R": 0.1, "P": 0.2, "PSI": 0.3, "R_DOT": 0.4, "P_DOT": 0.5, "PSI_DOT": 0.6,
           "V_FRONT": 7.0, "V_BACK": 8.0}  # fmt: skip
"""Values of the context array in the generated test: rad, rad/s, V"""
BOUND = 10.0
"""Bounds of the new effect's parameter: this multiple of its estimate, in both directions. Chosen
so that a rig with ten times the effect can still be identified."""


@dataclass(frozen=True)
class Formula:
    """A torque c · ``product`` of state variables, such as ``roll_rate*voltage_sum``, on an axis.

    c is ``value`` ± ``std`` in SI units; ``std`` is 0 if it is unknown.
    """

    axis: str
    product: str
    value: float
    std: float

    @property
    def name(self) -> str:
        """Return the effect's name, such as ``torque.voltage_front_times_voltage_back_on_yaw``."""
        words = re.sub(r"[^a-z_*]", "_", self.product).strip("_")
        return f"torque.{re.sub('_+', '_', words.replace('*', '_times_'))}_on_{self.axis}"

    @property
    def unit(self) -> str:
        unit = unit_of_product(self.product)
        return torque_per(unit)


def read_formulas(path: Path) -> list[Formula]:
    """Return the formulas in a diagnosis document or model file.

    Raises UsageError for a missing file, RecordingError for a file without a formula.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise no_file(path) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise _no_formula(path, "it is not a JSON file") from error
    schema = str(data.get("schema", "")) if isinstance(data, dict) else ""
    if schema.startswith("heli3dof.diagnosis/"):
        formulas = _of_diagnosis(data)
        why = "no torque of this diagnosis has a formula"
    elif schema.startswith("heli3dof.model/"):
        formulas = _of_model(path, data)
        why = "the model has no torque with a formula"
    else:
        formulas, why = [], "it is neither a diagnosis nor a model"
    if not formulas:
        raise _no_formula(path, why)
    return formulas


def _of_diagnosis(data: dict[str, Any]) -> list[Formula]:
    out = []
    for torque in data.get("leftover", ()):
        if torque.get("formula"):
            c = torque["formula_parameters"]["c"]
            product = torque["formula"].removeprefix("c * ").replace(" * ", "*")
            out.append(Formula(torque["axis"], product, float(c["value"]), float(c["std"])))
    return out


def _of_model(path: Path, data: dict[str, Any]) -> list[Formula]:
    model = read_model(path) if data.get("parameters") else None
    if not isinstance(model, GreyBoxModel):
        return []
    out, scale = [], thrust_scale(model)
    for p in data.get("parameters", ()):
        term, _, parameter = str(p["name"]).rpartition(".")
        effect, _, axis = term.rpartition(".")
        product = effect.removeprefix(PREFIX)
        if effect.startswith(PREFIX) and parameter == "coefficient" and factors(product):
            c = scale.to_si(float(p["value"]), float(p["std"] or 0), str(p["unit"]))
            out.append(Formula(axis, product, *c))
    return out


def package_files(formula: Formula, source: str) -> dict[str, str]:
    """Return {file name: text} of a package with the effect of ``formula``.

    ``source``: name of the file from which the formula was read.
    """
    module = module_name(formula.name)
    return {
        "pyproject.toml": pyproject(module),
        f"{module}.py": _module(formula, source),
        f"test_{module}.py": _test(formula, module),
    }


def module_name(effect: str) -> str:
    """Return the name of the Python module of an effect's package."""
    return "heli3dof_" + effect.replace(".", "_")


def pyproject(module: str, *, is_emulated: bool = False) -> str:
    """Return the pyproject.toml of a package with the effect ``module``.EFFECT.

    ``is_emulated``: the package also has the module ``module``_emulated for the emulated rig.
    """
    emulated = _EMULATED_GROUP.format(module=module) if is_emulated else ""
    modules = f'"{module}", "{module}_emulated"' if is_emulated else f'"{module}"'
    return _PYPROJECT.format(
        module=module, name=module.replace("_", "-"), emulated=emulated, modules=modules
    )


def _module(f: Formula, source: str) -> str:
    code = " * ".join(_code(name) for name in factors(f.product))
    indices = sorted(set(re.findall(r"\b(R|P|PSI|\w+_DOT|V_FRONT|V_BACK)\b", code)))
    return _MODULE.format(
        axis=f.axis, index=AXES.index(f.axis), product=f.product.replace("*", " · "), name=f.name,
        code=code, imports=", ".join(["A", *indices]), math="import math\n" * ("math." in code),
        unit=f.unit, value=f"{f.value:.4g}", std=f"{f.std:.2g}", source=source,
        bound=f"{BOUND * abs(f.value):.3g}", typical=f"{abs(f.value):.3g}", evidence=_evidence(f),
    )  # fmt: skip


def _evidence(f: Formula) -> str:
    """Return the variable against which a report plots the torque, such as ``yaw_rate``.

    It is the variable in the first factor of the formula's product: ``yaw_rate`` for
    ``abs(yaw_rate)*voltage_sum``.
    """
    return re.sub(r"\w+\((\w+)\)", r"\1", factors(f.product)[0])


def _code(name: str) -> str:
    kind, _, inner = name.rstrip(")").rpartition("(")
    function = {"sin": "math.sin({})", "cos": "math.cos({})", "abs": "abs({})", "": "{}"}[kind]
    return function.format(CODE[inner])


def _test(f: Formula, module: str) -> str:
    code = " * ".join(_code(name) for name in factors(f.product))
    numbers = re.sub(r"s\[(\w+)\]", lambda m: f"{EXAMPLE[m[1]]:g}", code)
    values = "\n".join(
        f"    s[{index}] = {value:g}" for index, value in EXAMPLE.items() if f"s[{index}]" in code
    )
    indices = [i for i in EXAMPLE if f"s[{i}]" in code]
    return _TEST.format(
        module=module, index=AXES.index(f.axis), numbers=numbers, values=values,
        imports=", ".join(sorted(["MEMORY", "PARAMETERS", "SIZE", *indices])),
        math="import math\n" * ("math." in code),
    )  # fmt: skip


def _no_formula(path: Path, why: str) -> RecordingError:
    return RecordingError(
        f"{path} contains no formula of an unmodelled torque.",
        cause=f"{why}.",
        fix="heli3dof diagnose REC.mcap --json > diagnosis.json",
    )


_PYPROJECT = """\
[build-system]
requires = ["setuptools>=64"]
build-backend = "setuptools.build_meta"

[project]
name = "{name}"
version = "0.1.0"
dependencies = ["heli3dof"]

[project.entry-points."heli3dof.effects"]
{module} = "{module}:EFFECT"
{emulated}
[tool.setuptools]
py-modules = [{modules}]
"""

_EMULATED_GROUP = """
[project.entry-points."heli3dof.emulated_effects"]
{module} = "{module}_emulated:EFFECTS"
"""

_MODULE = '''\
"""A torque on {axis}: τ = c · {product}.

c = {value} ± {std} {unit}, estimated in {source}.
"""

{math}from typing import Any

from heli3dof.model.effects import Effect, Parameter, Stage
from heli3dof.model.physics.state_layout import {imports}


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[{index}] += par[A] * {code}


EFFECT = Effect(
    name="{name}",
    summary="A torque c · {product}.",
    parameters=(
        Parameter("coefficient", "{unit}", 0.0, -{bound}, {bound}, {typical}, "c"),
    ),
    hooks={{Stage.TORQUE: torque}},
    axes=("{axis}",),
    evidence="{evidence}",
)
'''

_TEST = """\
{math}import numpy as np
import pytest
from heli3dof.model.physics.state_layout import {imports}

from {module} import torque


def test_the_torque_is_the_coefficient_times_the_product() -> None:
    s, par, out = np.zeros(SIZE), np.zeros(PARAMETERS), np.zeros(3)
{values}
    par[1] = 2.0
    torque(s, par, np.zeros(MEMORY), out)
    assert out[{index}] == pytest.approx(2.0 * {numbers})
    assert np.count_nonzero(out) == 1
"""

"""The registry of methods: plug-ins by entry point, no heavy imports."""

from __future__ import annotations

import logging
import subprocess
import sys
from importlib.metadata import EntryPoint
from typing import Any

import pytest

from heli3dof import plugins
from heli3dof.errors import UsageError
from heli3dof.identification import methods as registry
from heli3dof.identification.fit_result import FitResult
from heli3dof.identification.identify import identify
from heli3dof.identification.methods import BUILT_IN, Method, known_method, methods
from tests.recording.make import flight

MEAN = Method("mean", "predicts the mean", "tests.identification.test_methods:fit_mean")


def fit_mean(prepared: object, request: object) -> FitResult:
    """The function of a plug-in."""
    return FitResult(prepared, 0, 0.02, request)  # type: ignore[arg-type]


def fit_number(prepared: object, request: object) -> FitResult:
    numbers: Any = {"K_f": 0.1}
    return FitResult(prepared, 0, 0.02, request, parameters=numbers)  # type: ignore[arg-type]


def fit_singular(prepared: object, request: object) -> FitResult:
    raise ValueError("singular")


def fit_wrong(prepared: object, request: object) -> float:
    return 1.5


@pytest.fixture
def plug_in(monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    def register(value: str) -> None:
        point = EntryPoint("mean", value, registry.GROUP)
        monkeypatch.setattr(plugins, "entry_points", lambda group: [point])
        methods.cache_clear()

    yield register
    methods.cache_clear()


def test_an_entry_point_adds_a_method(plug_in) -> None:  # type: ignore[no-untyped-def]
    plug_in("tests.identification.test_methods:MEAN")
    found = known_method("mean").fit("a", "b")  # type: ignore[arg-type]
    assert (found.model, found.innovations) == ("a", "b")


@pytest.mark.parametrize(
    ("function", "says"),
    [
        (
            f"{__name__}:fit_wrong",
            "The method mean returned a float; a method returns a FitResult.",
        ),
        (
            f"{__name__}:fit_men",
            "cannot be imported from tests.identification.test_methods:fit_men",
        ),
        ("no_such_package:fit", "No module named 'no_such_package'"),
    ],
)
def test_a_wrong_function_is_an_error_that_names_the_method_and_it(
    function: str, says: str
) -> None:
    with pytest.raises(UsageError) as caught:
        Method("mean", "predicts the mean", function).fit("a", "b")  # type: ignore[arg-type]
    assert says in caught.value.what
    assert "mean" in caught.value.what
    assert caught.value.cause
    assert caught.value.fix


@pytest.mark.parametrize(
    ("function", "says", "where"),
    [
        (fit_singular, "ValueError: singular", f"{__file__}:"),
        (fit_number, "TypeError: it is a float; expected: Parameter", ""),
        (fit_mean, "AttributeError", ""),
    ],
)
def test_a_bug_in_a_method_names_the_method_and_its_package(
    plug_in,  # type: ignore[no-untyped-def]
    monkeypatch: pytest.MonkeyPatch,
    function: Any,
    says: str,
    where: str,
) -> None:
    plug_in(f"{__name__}:MEAN")
    monkeypatch.setitem(globals(), "fit_mean", function)
    with pytest.raises(UsageError, match=f"The method mean failed: {says}") as caught:
        identify(flight(5000), method="mean")
    assert "its package, tests" in caught.value.cause
    assert where in caught.value.cause


@pytest.mark.parametrize("value", ["no_such_package:METHOD", "math:pi"])
def test_a_broken_plug_in_is_left_out_with_a_warning(plug_in, caplog, value: str) -> None:  # type: ignore[no-untyped-def]
    plug_in(value)
    with caplog.at_level(logging.WARNING, "heli3dof"):
        assert list(methods()) == [m.name for m in BUILT_IN]
    assert value in caplog.text


def test_an_unknown_method_is_an_error_with_all_names() -> None:
    with pytest.raises(UsageError, match="greybox, oe, pbsid, pem"):
        known_method("zzz")


def test_listing_the_methods_imports_no_numerical_library() -> None:
    code = (
        "import sys; from heli3dof.identification.methods import methods; methods();"
        "print([m for m in ('numpy', 'scipy', 'numba') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"

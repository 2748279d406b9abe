"""Model files: what is written is read back, and what cannot be used says why."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.errors import NoSpace, OutputExists, RecordingError, UsageError
from heli3dof.json_values import jsonable
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.linear.model import LinearModel
from heli3dof.model.model_file import SCHEMA, read_model, save_model
from heli3dof.paper.models import BUILT_IN, load_model
from tests.model.examples import PROFILE, in_another_basis
from tests.paths import ROOT

HOVER = hover_model(PROFILE)


def saved(tmp_path: Path, **changes: Any) -> Path:
    """A good model file with some keys changed; None takes a key out."""
    path = save_model(HOVER, tmp_path / "model.json")
    data = json.loads(path.read_text())
    data.update(changes)
    path.write_text(json.dumps({k: v for k, v in data.items() if v is not None}))
    return path


def assert_same(a: LinearModel, b: LinearModel) -> None:
    for name in ("A", "B", "C", "K", "S", "u0", "y0"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert (a.name, a.kind, a.dt, a.exact_hold) == (b.name, b.kind, b.dt, b.exact_hold)


@pytest.mark.parametrize("name", BUILT_IN)
def test_every_built_in_model_survives_the_file_to_the_last_bit(name: str, tmp_path: Path) -> None:
    model = load_model(name, PROFILE)
    assert isinstance(model, LinearModel)
    back = load_model(save_model(model, tmp_path / "m.json"), PROFILE)
    assert isinstance(back, LinearModel)
    assert_same(model, back)
    assert back.extra == model.extra


@given(st.integers(1, 9), st.integers(0, 2**32 - 1), st.booleans())
@settings(max_examples=20, deadline=None)
def test_any_linear_model_survives(order: int, seed: int, partial: bool) -> None:
    import tempfile

    rng = np.random.default_rng(seed)
    C = rng.normal(size=(3, order))
    if partial:
        C[1] = np.nan
    model = LinearModel(
        "m", "tf4", rng.normal(size=(order, order)), rng.normal(size=(order, 2)), C,
        rng.normal(size=(order, 3)), np.eye(3), rng.normal(size=2), rng.normal(size=3), 0.002,
        extra={"poles_std": [0.1, 0.2], "recordings": ["a.mcap"]},
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        back = read_model(save_model(model, Path(folder) / "m.json"))
    assert isinstance(back, LinearModel)
    assert_same(model, back)
    assert back.extra == model.extra


def test_a_file_is_json_with_a_schema_that_other_tools_can_read(tmp_path: Path) -> None:
    data = json.loads(save_model(HOVER, tmp_path / "m.json").read_text())
    assert data["schema"] == SCHEMA
    assert data["form"] == "linear"
    assert data["u0_V"] == [7.456, 7.456]
    assert data["S"] == [[None] * 3] * 3


def test_nothing_is_overwritten_without_force(tmp_path: Path) -> None:
    path = save_model(HOVER, tmp_path / "m.json")
    before = path.read_bytes()
    with pytest.raises(OutputExists) as caught:
        save_model(in_another_basis(HOVER), path)
    assert "force=True" in caught.value.fix
    assert path.read_bytes() == before
    save_model(in_another_basis(HOVER), path, force=True)
    assert path.read_bytes() != before


def test_a_write_that_fails_leaves_the_old_file_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = save_model(HOVER, tmp_path / "m.json")
    before = path.read_bytes()

    def full(fd: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(NoSpace):
        save_model(HOVER, path, force=True)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="There is no folder"):
        save_model(HOVER, tmp_path / "no" / "m.json")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"schema": "heli3dof.model/2"}, "is version '2' of the model file"),
        ({"schema": None}, "its 'schema' is missing"),
        ({"schema": "heli3dof.diagnosis/1"}, "is not a model file"),
        ({"form": "greybocks"}, "unknown form 'greybocks'"),
        ({"form": None}, "unknown form None"),
        ({"form": ["linear"]}, "unknown form"),
        ({"B": None}, "lacks the key 'B'"),
        ({"dt_s": None}, "lacks the key 'dt_s'"),
        ({"A": [[1, 2]]}, "A has the shape (1, 2), not (1, 1)"),
        ({"u0_V": [1, 2, 3]}, "u0_V has the shape (3,), not (2,)"),
        ({"A": "text"}, "is inconsistent"),
        ({"A": 3}, "is inconsistent"),
        ({"dt_s": 0}, "dt_s is 0.0"),
        ({"dt_s": "fast"}, "is inconsistent"),
        ({"y0_rad": [0, 0, None]}, "y0_rad holds null"),
    ],
)
def test_a_file_that_cannot_be_used_says_what_about_it(
    changes: dict[str, Any], says: str, tmp_path: Path
) -> None:
    path = saved(tmp_path, **changes)
    with pytest.raises(RecordingError) as caught:
        read_model(path)
    assert says in caught.value.what
    assert str(path) in caught.value.what
    assert caught.value.exit_code == 5
    assert caught.value.cause
    assert caught.value.fix


@pytest.mark.parametrize("content", [b"", b"{", b"\x89MCAP0\r\n", b"[1, 2]", b"3", b"\xff\xfe"])
def test_a_file_of_another_kind_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    path.write_bytes(content)
    with pytest.raises(RecordingError):
        read_model(path)


def test_a_file_that_is_not_there_or_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="There is no model file"):
        load_model(tmp_path / "none.json", PROFILE)
    with pytest.raises(RecordingError, match="cannot be read"):
        load_model(tmp_path, PROFILE)


def test_a_misspelt_built_in_name_gets_the_nearest_one() -> None:
    with pytest.raises(UsageError, match="hovver") as caught:
        load_model("hovver", PROFILE)
    assert "'hover'" in caught.value.cause
    assert caught.value.fix == "again with hover"


def test_an_old_name_is_read_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    model = load_model("paper-17-mended", PROFILE)
    assert model.name == "paper-17-corrected"
    assert "is now called paper-17-corrected" in caplog.text


def test_a_built_in_model_is_made_for_the_profile() -> None:
    slow = PROFILE.model_copy(update={"loop": PROFILE.loop.model_copy(update={"rate_hz": 200.0})})
    model = load_model("hover", slow)
    assert isinstance(model, LinearModel)
    assert model.dt == 0.005


def test_numpy_nan_and_complex_become_plain_json() -> None:
    value = {"a": np.float64(1.5), "b": np.array([1.0, np.nan]), "c": 1 + 2j, "d": (np.int64(3),)}
    assert jsonable(value) == {"a": 1.5, "b": [1.0, None], "c": [1.0, 2.0], "d": [3]}


def test_extras_with_arrays_and_nan_are_written(tmp_path: Path) -> None:
    model = replace(HOVER, extra={"std": np.array([[0.1, np.nan]]), "n": np.int64(4)})
    back = read_model(save_model(model, tmp_path / "m.json"))
    assert isinstance(back, LinearModel)
    assert back.extra == {"std": [[0.1, None]], "n": 4}


def test_the_page_on_the_format_lists_every_key() -> None:
    page = (ROOT / "docs" / "reference" / "model-file.md").read_text(encoding="utf-8")
    for key in {"schema", *HOVER.to_dict()}:
        assert f"`{key}`" in page, key


def test_reading_a_model_does_not_import_the_heavy_libraries(tmp_path: Path) -> None:
    path = save_model(HOVER, tmp_path / "m.json")
    code = (
        "import sys; from heli3dof.model.model_file import read_model; "
        f"read_model({str(path)!r}); "
        "print([m for m in ('numba', 'control', 'scipy', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

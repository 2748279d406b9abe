"""Effects of other packages: used where they load, named with file and fix where they do not."""

from __future__ import annotations

import json
import logging
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from heli3dof.errors import RecordingError, UsageError
from heli3dof.model import effects as package
from heli3dof.model.effects import effects, plug_ins, term
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.model_file import read_model, save_model
from heli3dof.rig.profile import default_profile
from tests.cli.running import heli3dof

WOBBLE = """
from heli3dof.model.effects import Effect, Parameter, Stage

def hook(s, par, mem, out):
    out[0] += {body}

EFFECT = Effect(
    "acme.wobble", "A wobble.",
    (Parameter("torque_Nm", "N·m", 0.0, -1.0, 1.0, 0.1, "its size"),),
    {{Stage.TORQUE: hook}},
)
"""
SOUND = WOBBLE.format(body="par[1]")
Install = Callable[[str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Put the package acme-wobble 1.2 with that code where Python finds it."""

    def put(code: str) -> None:
        site = tmp_path / f"site{len(list(tmp_path.glob('site*')))}"
        about = site / "acme_wobble-1.2.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text("Name: acme-wobble\nVersion: 1.2\n", encoding="utf-8")
        (about / "entry_points.txt").write_text(
            "[heli3dof.effects]\nwobble = acme_wobble:EFFECT\n", encoding="utf-8"
        )
        (site / "acme_wobble.py").write_text(code, encoding="utf-8")
        monkeypatch.syspath_prepend(str(site))
        monkeypatch.delitem(__import__("sys").modules, "acme_wobble", raising=False)
        package._all.cache_clear()

    yield put
    monkeypatch.undo()
    __import__("sys").modules.pop("acme_wobble", None)
    package._all.cache_clear()


def model_file(path: Path) -> Path:
    """A model with the plug-in's effect, as `identify` writes it."""
    model = GreyBoxModel(
        "m", default_profile(), ("acme.wobble",), np.array([6.5, 1.0, 0.04, 1.0, 0.1]),
        np.full(3, 0.1), np.eye(5), 0.0,
    )  # fmt: skip
    return save_model(model, path)


def test_a_model_file_says_which_plug_in_its_effect_is_of(install: Install, tmp_path: Path) -> None:
    install(SOUND)
    path = model_file(tmp_path / "m.json")
    assert json.loads(path.read_text())["plug_ins"] == {
        "acme.wobble": {
            "entry_point": "acme_wobble:EFFECT", "distribution": "acme-wobble", "version": "1.2",
        }
    }  # fmt: skip
    assert isinstance(read_model(path), GreyBoxModel)
    assert list(plug_ins()) == ["acme.wobble"]


def test_a_model_file_without_its_plug_in_names_the_package_to_install(
    install: Install, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(SOUND)
    path = model_file(tmp_path / "m.json")
    monkeypatch.undo()
    package._all.cache_clear()
    with pytest.raises(RecordingError) as caught:
        read_model(path)
    error = caught.value
    assert "m.json cannot be used here: Its effect 'acme.wobble' is of the plug-in" in error.what
    assert "acme_wobble:EFFECT of the package acme-wobble 1.2" in error.what
    assert error.cause == "the package is not installed here."
    assert error.fix == "install acme-wobble 1.2 from where you got it: pip install FOLDER"


@pytest.mark.parametrize(
    ("code", "line", "why"),
    [
        ("import no_such_module\n" + SOUND, 1, "No module named 'no_such_module'"),
        ("\n\ndef hook(:\n", 3, "SyntaxError"),
        (WOBBLE.format(body="'a text'"), 4, "does not compile"),
        (WOBBLE.format(body="no_such_name"), 4, "no_such_name"),
        (WOBBLE.format(body="par[1] * s[3] ** 0.5"), 4, "TORQUE: the equation gives a number that"),
        (WOBBLE.format(body="0.1"), 4, "adds a torque although each parameter has its null"),
        (WOBBLE.replace("out[0]", "out[3]").format(body="par[1]"), 4, "index 3 is outside"),
        (SOUND.replace('acme.wobble"', 'drag.quadratic.yaw"'), 0, "ends in an axis"),
        (SOUND.replace("-1.0, 1.0", "1.0, 0.0"), 9, "low is 1, not below high"),
        ("EFFECT = 3\n", 0, "it is a int, not an Effect"),
        ("raise SystemExit\n", 1, "SystemExit"),
    ],
    ids=[
        "import",
        "syntax",
        "type",
        "name",
        "nan",
        "null",
        "index",
        "axis",
        "bounds",
        "kind",
        "exit",
    ],
)
def test_a_broken_plug_in_is_named_with_its_file_and_left_out(
    code: str, line: int, why: str, install: Install, tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    install(SOUND)
    path = model_file(tmp_path / "m.json")
    install(code)
    with caplog.at_level(logging.WARNING):
        assert "acme.wobble" not in effects()
    assert "motor.lag" in effects()
    warned = caplog.text
    assert "the plug-in acme_wobble:EFFECT of the package acme-wobble 1.2 does not load" in warned
    assert why in warned
    assert f"acme_wobble.py:{line}" * bool(line) in warned
    assert "Correct " + str(tmp_path / "site1" / "acme_wobble.py") in warned
    assert "pip uninstall acme-wobble" in warned
    with pytest.raises(RecordingError) as caught:
        read_model(path)
    assert why in caught.value.cause
    with pytest.raises(UsageError) as refused:
        term("acme.wobble")
    assert why in refused.value.cause


def test_a_plug_in_loads_from_the_folder_in_which_it_was_checked(
    install: Install, tmp_path: Path
) -> None:
    install(SOUND)
    file = tmp_path / "site0" / "acme_wobble.py"
    subprocess.run([sys.executable, "-m", "heli3dof", "effect", "check", file], check=True)
    assert "acme.wobble" in effects()


def test_verbs_that_do_not_need_it_work_beside_a_broken_plug_in(
    install: Install, tmp_path: Path
) -> None:
    install(WOBBLE.format(body="'a text'"))
    said = heli3dof("simulate", "steps", "--model", "hover", "-o", tmp_path / "s.mcap")
    assert said.code == 0, said.err
    said = heli3dof("info", tmp_path / "s.mcap")
    assert said.code == 0, said.err

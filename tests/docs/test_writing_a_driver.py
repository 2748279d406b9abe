"""The driver of write-a-driver.md passes the conformance suite when installed as described."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from heli3dof.errors import DeviceError, UsageError
from heli3dof.rig.drivers import load_driver, open_driver
from heli3dof.rig.interface import Command
from heli3dof.rig.profile import default_profile
from tests.paths import ROOT
from tests.profiles import END_S

from .lab_amplifier import LabAmplifier

PAGE = (ROOT / "docs" / "how-to" / "write-a-driver.md").read_text(encoding="utf-8")


def block(language: str, which: int = 0) -> str:
    """A code block of the page."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[which]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with the page's package in it, as pip would leave it there."""
    project = tomllib.loads(block("toml"))["project"]
    (group, drivers), *_ = project["entry-points"].items()
    (module,) = {target.partition(":")[0] for target in drivers.values()}
    (tmp_path / f"{module}.py").write_text(block("python"), encoding="utf-8")
    about = tmp_path / f"{module}-{project['version']}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    lines = [f"[{group}]", *(f"{name} = {target}" for name, target in drivers.items())]
    (about / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return tmp_path


@pytest.fixture
def installed(package: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(package)
    yield
    sys.modules.pop("lab_amplifier", None)


@pytest.fixture
def amplifier() -> Iterator[LabAmplifier]:
    made = LabAmplifier()
    yield made
    made.close()


def test_a_driver_that_is_installed_later_is_found(package: Path, installed: None) -> None:
    (about,) = package.glob("*.dist-info")
    moved = about.rename(package / "not-yet-installed")
    with pytest.raises(UsageError, match="There is no driver for 'lab:'"):
        load_driver("lab")
    moved.rename(about)
    assert load_driver("lab").options == ()


@pytest.mark.parametrize("where", ["127.0.0.1", "127.0.0.1:", ":4000", "bench-7:port"])
def test_an_address_without_host_or_port_is_a_wrong_use(installed: None, where: str) -> None:
    with pytest.raises(UsageError, match="lacks HOST:PORT"):
        open_driver(f"lab://{where}", default_profile())


def test_the_package_installs_with_its_test_next_to_it(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setuptools = pytest.importorskip("setuptools")  # finds two modules and refuses to choose
    (package / "pyproject.toml").write_text(block("toml"), encoding="utf-8")
    (package / "test_lab.py").touch()
    monkeypatch.chdir(package)
    found = setuptools.Distribution()
    found.parse_config_files()
    found.set_defaults()
    assert found.py_modules == ["lab_amplifier"]


def test_the_pages_own_test_of_the_driver_passes(package: Path, amplifier: LabAmplifier) -> None:
    test = block("python", 1)
    assert "lab://bench-7:4000" in test
    (package / "test_lab.py").write_text(test.replace("bench-7:4000", amplifier.place))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-rs", "test_lab.py"],
        cwd=package, env={**os.environ, "PYTHONPATH": os.pathsep.join([str(package), *sys.path])},
        capture_output=True, text=True, timeout=END_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("SKIPPED") <= 1  # it counts nothing


def test_a_pulled_cable_is_an_error_and_closing_is_quiet(
    installed: None, amplifier: LabAmplifier
) -> None:
    rig = open_driver(f"lab://{amplifier.place}", default_profile())
    rig.arm()
    amplifier.hang_up()
    with pytest.raises(DeviceError, match=f"lab://{amplifier.place}"):
        rig.exchange(Command(1, 1.0, 1.0), 0.0)
    rig.close()


@pytest.mark.parametrize(
    "answer", ["12 3.0 44", "a b c d e f g h", "", "NO fuse blown", "\udcff\udcfe"], ids=repr
)
def test_a_garbled_or_refusing_answer_is_an_error_with_its_cause(
    installed: None, amplifier: LabAmplifier, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    rig = open_driver(f"lab://{amplifier.place}", default_profile())
    rig.arm()
    monkeypatch.setattr(amplifier, "_answer", lambda line, words: answer)
    with pytest.raises(DeviceError, match=f"lab://{amplifier.place}") as caught:
        rig.exchange(Command(1, 1.0, 1.0), 0.0)
    assert "refused line or garbled answer" in caught.value.cause
    rig.close()


def test_a_silent_amplifier_is_a_matter_of_cable_or_supply(
    installed: None, amplifier: LabAmplifier
) -> None:
    rig = open_driver(f"lab://{amplifier.place}", default_profile())
    amplifier.hang_up()
    with pytest.raises(DeviceError) as caught:
        rig.read()
    assert caught.value.cause == "cable or supply"
    rig.close()


def test_an_amplifier_that_is_off_is_an_error_that_says_what_to_do(installed: None) -> None:
    with pytest.raises(DeviceError) as caught:
        open_driver("lab://127.0.0.1:1", default_profile())
    assert "refused" in caught.value.what.lower()
    assert caught.value.fix

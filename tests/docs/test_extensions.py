"""Every example of CONTRIBUTING.md, in a scratch folder that its registry also searches, works."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from typer.testing import CliRunner

import heli3dof as h3
from tests.flown import first_part
from tests.paths import ROOT

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
EXAMPLE = re.compile(r"```(?:python|toml)\n# ([a-z ]+): (\S+)\n(.*?)```", re.DOTALL)
EXAMPLES = {kind: (file, code) for kind, file, code in EXAMPLE.findall(PAGE)}
FLIGHT = ROOT / "recordings" / "step-roll-10.mcap"

Place = Callable[[str, str], ModuleType]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Place]:
    """Writes an example as a module of a package that searches a scratch folder too."""
    placed: list[str] = []

    def write(kind: str, package: str) -> ModuleType:
        file, code = EXAMPLES[kind]
        (tmp_path / file).write_text(code, encoding="utf-8")
        home = importlib.import_module(package)
        monkeypatch.setattr(home, "__path__", [*home.__path__, str(tmp_path)])
        importlib.invalidate_caches()
        placed.append(f"{package}.{Path(file).stem}")
        return importlib.import_module(placed[-1])

    yield write
    for name in placed:
        sys.modules.pop(name, None)


@pytest.fixture
def searched_again() -> Iterator[Callable[[Callable[..., object]], None]]:
    """Clears a registry's cache now and after the test."""
    cleared: list[Callable[..., object]] = []

    def clear(registry: Callable[..., object]) -> None:
        registry.cache_clear()  # type: ignore[attr-defined]
        cleared.append(registry)

    yield clear
    for registry in cleared:
        registry.cache_clear()  # type: ignore[attr-defined]


def test_the_page_has_an_example_of_every_kind() -> None:
    table = PAGE[PAGE.index("| kind | file |") : PAGE.index("More places:")]
    kinds = {row.split("|")[1].strip() for row in table.splitlines()[2:] if row.startswith("|")}
    headings = {h.lower() for h in re.findall(r"^### (.*)$", PAGE, re.MULTILINE)}
    assert kinds - headings == {"driver"}  # docs/how-to/write-a-driver.md has its own test
    assert len(EXAMPLES) == len(headings)


def extension_table() -> list[list[str]]:
    """Returns the cells of the table's rows: kind, file, entry point, commands."""
    rows = PAGE[PAGE.index("| kind | file |") :].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]


def test_every_command_of_the_table_exists() -> None:
    """Its files and folders, its make targets and its modules."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for *_, commands in extension_table():
        for command in re.findall(r"`([^`]+)`", commands):
            first, *words = command.split()
            if first == "pytest":
                assert words
                assert not [w for w in words if not (ROOT / w).exists()], command
            elif first == "make":
                assert re.search(rf"^{words[0]}:", makefile, re.MULTILINE), command
            elif first == "python":
                assert importlib.util.find_spec(words[1]), command
            else:
                assert first == "heli3dof", command


def test_every_folder_of_the_table_exists() -> None:
    for _, file, *_ in extension_table():
        for path in re.findall(r"`([\w/]+)/\w+\.\w+`", file):
            assert (ROOT / path).is_dir(), path


def test_every_entry_point_group_of_the_table_has_its_object() -> None:
    from heli3dof_drivers.emulator import effects as emulated

    from heli3dof.cli import app
    from heli3dof.identification import methods
    from heli3dof.model import effects
    from heli3dof.recording.logs import importers
    from heli3dof.rig import drivers

    several = (app, drivers, effects, emulated, importers, methods)
    homes = {module.GROUP: module for module in several}
    stated = {}
    for kind, _, entry, _ in extension_table():
        if match := re.match(r"`(heli3dof\.\w+)`(?:: `(\w+)`)?", entry):
            stated[match[1]] = (kind, match[2])
    assert stated.keys() == homes.keys()
    for kind, name in stated.values():
        if name is not None:
            assert re.search(rf"^(def )?{name}\b", example(kind)[1], re.MULTILINE), kind


def example(kind: str) -> tuple[str, str]:
    """Returns file and code of the example of a kind in the table."""
    short = {"effect of the models": "effect", "effect of the emulated rig": "emulated effect"}
    return EXAMPLES[short.get(kind, kind)]


PYTHON = {kind: code for kind, (file, code) in EXAMPLES.items() if file.endswith(".py")}


@pytest.mark.parametrize("kind", PYTHON)
def test_an_example_passes_the_linter_and_is_annotated(kind: str) -> None:
    """mypy runs for a minute; it needs the annotations of every function."""
    for node in ast.walk(ast.parse(PYTHON[kind])):
        if isinstance(node, ast.FunctionDef):
            arguments = [a for a in node.args.args if a.arg != "self"]
            assert node.returns is not None, node.name
            assert all(a.annotation is not None for a in arguments), node.name
    for words in (["check"], ["format", "--diff"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *words, "--stdin-filename", "heli3dof/x.py", "-"],
            input=PYTHON[kind], cwd=ROOT, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_table_of_stages_names_the_stages_of_both_sides() -> None:
    from heli3dof_drivers.emulator import plant_layout

    from heli3dof.model.physics import state_layout

    rows = PAGE[PAGE.index("| `out` | hook |") :].split("\n\n")[0].splitlines()[2:]
    for column, layout in ((3, state_layout), (4, plant_layout)):
        stated = {re.search(r"`([A-Z_]+)`", row.split("|")[column])[1] for row in rows}  # type: ignore[index]
        assert stated == {stage.name for stage in layout.Stage}


def test_the_page_names_every_kind_and_stage_of_an_integrity_check() -> None:
    from heli3dof.integrity import Kind, Stage

    names = {k for k, v in vars(Kind).items() if isinstance(v, str) and k.isupper()}
    for name in names | {stage.name for stage in Stage}:
        assert f"`{name}`" in PAGE, name


def test_every_file_that_the_walks_name_exists() -> None:
    diagnosis = (ROOT / "docs" / "explanation" / "diagnosis.md").read_text(encoding="utf-8")
    walks = PAGE[PAGE.index("## The life of a sample") : PAGE.index("## Extensions")] + diagnosis
    for path in re.findall(r"`((?:heli3dof|drivers|tests)/[\w/]+(?:\.\w+|/))`", walks):
        assert (ROOT / path).exists(), path


def test_an_effect_of_the_models_is_found_and_compiles(place, searched_again) -> None:
    from heli3dof.model import effects
    from heli3dof.model.physics.compiled_effects import address
    from heli3dof.model.physics.state_layout import AXIS, R_DOT, A

    module = place("effect", "heli3dof.model.effects")
    searched_again(effects._all)
    assert effects.term("drag.cubic.yaw").effect is module.EFFECT
    assert address(module.torque)
    state, par, out = np.zeros(32), np.zeros(8), np.zeros(8)
    state[R_DOT + 2], par[AXIS], par[A] = 2.0, 2, 0.5
    module.torque(state, par, np.zeros(8), out)
    assert out[2] == -4.0  # 0.5 · 2³


def test_an_effect_of_the_emulated_rig_slows_the_arm(place, searched_again) -> None:
    from heli3dof_drivers.emulator import effects

    place("emulated effect", "heli3dof_drivers.emulator.effects")
    searched_again(effects.catalogue)

    def fastest(hide: str) -> float:
        device = f"mock:?speed=max&noise=0&start=level{hide}"
        flown = h3.fly_plan(first_part("doublets", 25.0), device=device).recording
        return float(np.abs(flown.angle[25:, 1] - flown.angle[:-25, 1]).max())  # rad in 50 ms

    assert fastest("&hide=drag.cubic.pitch:5") < 0.9 * fastest("")


def test_a_plan_can_be_read(tmp_path: Path) -> None:
    file, code = EXAMPLES["plan"]
    (tmp_path / file).write_text(code, encoding="utf-8")
    assert h3.load_plan(tmp_path / file).name == "two-heights"


def test_a_segment_renders_its_voltages(place, searched_again, tmp_path: Path) -> None:
    from heli3dof.experiment import segments

    place("segment", "heli3dof.experiment.segments")
    searched_again(segments.kinds)
    clock = segments.Clock(500, 0.002, np.random.default_rng(0))
    segment = segments.kinds()["pulse"](kind="pulse", duration_s=1.0)
    references, extra = segment.render(clock, np.zeros(3))
    assert references.shape == (500, 3)
    assert extra.sum(axis=0) == pytest.approx([100.0, 100.0])  # 1 V for 0.2 s at 500 Hz


def test_an_importer_reads_a_log(place, searched_again, tmp_path: Path) -> None:
    place("importer", "heli3dof.recording.logs.importers")
    searched_again(importlib.import_module("heli3dof.recording.logs.importers").importers)
    flown = h3.load(FLIGHT)
    log = tmp_path / "flight.jsonl"
    names = ["t_s", "v_front_V", "v_back_V", "roll_rad", "pitch_rad", "yaw_rad"]
    rows = np.column_stack([flown.t, flown.voltage, flown.angle])[:2000]
    lines = ["{" + ", ".join(f'"{n}": {v!r}' for n, v in zip(names, r, strict=True)) + "}"
             for r in rows.tolist()]  # fmt: skip
    log.write_text("\n".join(lines), encoding="utf-8")
    imported = h3.load(log, h3.load_profile(ROOT / "recordings" / "rig.toml"))
    assert np.array_equal(imported.angle, flown.angle[:2000])


def test_an_integrity_check_reports_a_short_recording(place, searched_again) -> None:
    from heli3dof import integrity

    place("integrity check", "heli3dof.integrity")
    searched_again(integrity.checks)
    flown = h3.load(FLIGHT)
    result = [fault.check for fault in integrity.integrity(flown.rows(slice(0, 3000)))]
    assert "length.short" in result
    assert "length.short" not in [fault.check for fault in integrity.integrity(flown)]


def test_a_safety_monitor_ends_a_flight(place, searched_again, tmp_path: Path) -> None:
    from heli3dof.experiment import safety_monitors

    place("safety monitor", "heli3dof.experiment.safety_monitors")
    searched_again(safety_monitors.monitor_classes)
    plan = tmp_path / "turn.toml"
    plan.write_text(
        'name = "turn"\n[[segment]]\nkind = "step"\nyaw_deg = 400\nduration_s = 30\n',
        encoding="utf-8",
    )
    flight = h3.fly_plan(h3.load_plan(plan), device="mock:?speed=max&start=level")
    assert "more than one revolution" in flight.outcome.detail


def test_the_row_and_the_test_of_a_safety_monitor_hold(
    place, searched_again, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from heli3dof.experiment import safety_monitors
    from tests.safety import table, test_in_process
    from tests.safety.aboard import Aboard

    place("safety monitor", "heli3dof.experiment.safety_monitors")
    searched_again(safety_monitors.monitor_classes)
    row, test = (
        re.search(rf"```(?:python)?\n# {kind}\n(.*?)```", PAGE, re.DOTALL)[1]  # type: ignore[index]
        for kind in ("row", "its test")
    )
    (made,) = eval(row, vars(table))
    monkeypatch.setitem(table.BY_NAME, made.name, made)
    functions: dict[str, Callable[[Aboard], None]] = {}
    exec(test, dict(vars(test_in_process)), functions)
    functions[f"test_{made.name}"](Aboard(monkeypatch, tmp_path))


def test_a_check_of_doctor_is_found(place, tmp_path: Path) -> None:
    from heli3dof.rig.doctor import folder

    place("doctor check", "heli3dof.rig.doctor")
    result = {check.what: check for check in folder.checks(tmp_path)}
    assert "lifetime of recordings" in result


def test_a_method_fits_and_is_named(
    searched_again, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from heli3dof import plugins
    from heli3dof.identification import methods

    file, code = EXAMPLES["identification method"]
    (tmp_path / file).write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    point = EntryPoint("pem8", f"{Path(file).stem}:METHOD", methods.GROUP)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point])
    searched_again(methods.methods)
    fitted = h3.identify(h3.load(ROOT / "recordings" / "train-1.mcap"), method="pem8")
    assert fitted.model.kind


def test_a_verb_prints_its_document(place, tmp_path: Path) -> None:
    import typer

    module = place("verb", "heli3dof.cli")
    app = typer.Typer()
    module.register(app)
    app.callback()(lambda: None)
    done = CliRunner().invoke(app, ["duration", str(FLIGHT), "--json"])
    assert done.exit_code == 0, done.output
    assert '"duration_s"' in done.output
    assert "heli3dof duration" in CliRunner().invoke(app, ["duration", "--help"]).output
    log = h3.export(h3.load(FLIGHT), tmp_path / "log.csv")
    rig = str(ROOT / "recordings" / "rig.toml")
    done = CliRunner().invoke(app, ["duration", str(log), "--profile", rig])
    assert done.exit_code == 0, done.output


def test_a_bench_measures_something(place) -> None:
    module = place("bench", "tests.bench")
    assert module.measure()[0].met

"""The peers bench without its tools: task and result files, physics, scores."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from heli3dof.model.discretisation import c2d_zoh
from heli3dof.rig.profile import default_profile
from tests.bench import bench_peers
from tests.bench.__main__ import SLOW, topics
from tests.bench.peers import flights, interface, judge, ours, rigid, sampling, tools
from tests.bench.peers.interface import Found, Meter, Task, read_found
from tests.bench.peers.rigid_model import RigidModel

ROOT = Path(__file__).parent.parent
TRUTH, KNOWN = flights.truth(), flights.known()


def black_box(interval_s: float, *, feedthrough: float = 0.0) -> dict[str, np.ndarray]:
    """The true rig about hover as a discrete model."""
    A, B = c2d_zoh(*rigid.linearised(TRUTH, KNOWN), interval_s)
    zero = {"u0": np.full(2, 7.0), "y0": np.zeros(3)}
    return {
        "A": A, "B": B, "C": np.eye(3, 8), "D": np.full((3, 2), feedthrough),
        "K": np.zeros((8, 3)), "S": np.eye(3), **zero,
    }  # fmt: skip


def test_a_task_is_read_back_unchanged(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    task = Task(
        np.arange(50) * 0.002, rng.normal(size=(50, 2)), rng.normal(size=(50, 3)),
        flights.nominal(), KNOWN, np.full(3, 1e-3), np.full(3, 0.01),
    )  # fmt: skip
    interface.write_task(tmp_path / "task.npz", task)
    back = interface.read_task(tmp_path / "task.npz")
    for name, value in vars(task).items():
        np.testing.assert_array_equal(getattr(back, name), value)
    assert back.dt == pytest.approx(0.002)


def test_every_kind_of_model_is_read_back_with_its_cost_and_setting(tmp_path: Path) -> None:
    meter, path = Meter(1.5, 64.0), tmp_path / "found.npz"
    A = np.diag([-1.0, -2.0])
    for kind, write in {
        "discrete": lambda: interface.write_linear(path, meter, "how", interval_s=0.04, A=A),
        "continuous": lambda: interface.write_linear(path, meter, "how", A=A),
        "exact": lambda: interface.write_exact(path, meter, "how", A=A),
        "physical": lambda: interface.write_physical(path, meter, "how", TRUTH, TRUTH),
    }.items():
        write()
        result = read_found(path)
        assert (result.kind, result.setting, result.cpu_s, result.peak_MB) == (
            kind,
            "how",
            1.5,
            64.0,
        )
        key, value = ("values", TRUTH) if kind == "physical" else ("A", A)
        np.testing.assert_array_equal(result.arrays[key], value)


def test_a_fit_every_40_ms_is_judged_as_the_continuous_plant_it_came_from() -> None:
    result = Found("discrete", "", 0, 0, {**black_box(0.04), "interval_s": np.array(0.04)})
    model = judge.linear_model(result, KNOWN, 0.002)
    want = black_box(0.002)
    response = model.C @ np.linalg.matrix_power(model.A, 50) @ model.B
    np.testing.assert_allclose(
        response, want["C"] @ np.linalg.matrix_power(want["A"], 50) @ want["B"], atol=1e-9
    )


def test_a_feedthrough_acts_one_control_period_later() -> None:
    arrays = {**black_box(0.04, feedthrough=0.5), "interval_s": np.array(0.04)}
    model = judge.linear_model(Found("discrete", "", 0, 0, arrays), KNOWN, 0.002)
    slow = black_box(0.002)
    np.testing.assert_allclose(model.C @ model.B, 0.5 + slow["C"] @ slow["B"], atol=1e-9)


def test_the_linearised_rig_has_the_papers_numbers() -> None:
    # Table I: B[4, ·] = L_a K_f / J_r, E4's 0.5810 rad/s² per V, and E3's −1.2304 = −T_g / J_yaw.
    A, B = rigid.linearised(flights.nominal(), KNOWN)
    tau = flights.GUESS["tau_m"]
    per_volt = A[3:6, 6:] @ B[6:] * tau
    np.testing.assert_allclose(per_volt[0], 0.6604 * 0.1188 / 0.914455, rtol=1e-4)
    np.testing.assert_allclose(per_volt[1], [0.5810, -0.5810], atol=5e-5)
    assert A[5, 1] == pytest.approx(-1.2304, abs=1e-4)


def test_the_rig_is_at_equilibrium_in_level_hover() -> None:
    P = (*TRUTH.tolist(), *KNOWN.tolist())
    V_h = P[3] / (2 * P[10] * P[12])
    np.testing.assert_allclose(rigid.derivative(*[0.0] * 8, V_h, V_h, P), np.zeros(8), atol=1e-12)


@pytest.mark.accuracy
def test_without_noise_the_true_model_replays_the_emulated_rig_within_a_count(
    tmp_path: Path,
) -> None:
    # Two derivations, two integrators: they differ by the rounding of readings, 1/√12 count.
    flown = judge.flights([flights.fly("multisine", 7, tmp_path, noise=0.0)])
    model = RigidModel(TRUTH, KNOWN)
    (y, replayed), *_ = judge.validation.replays(model, flown, flown.held_out)
    rms = np.sqrt(np.mean((y - replayed) ** 2, axis=0))
    counts = rms / np.abs(default_profile().encoder.rad_per_count)
    assert (counts < 0.4).all(), counts


def test_a_missing_pole_does_not_change_the_pairs_of_the_others() -> None:
    true = judge.true_poles(TRUTH, KNOWN)
    rotor, body, drift = judge.pole_errors(np.delete(true, 0), true)
    assert (rotor, body, drift) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    rotor, body, _ = judge.pole_errors(true[2:], true)
    assert np.isnan(rotor)
    assert body == pytest.approx(0.0, abs=1e-6)


def test_a_rotor_pole_off_by_a_tenth_counts_ten_percent() -> None:
    true = judge.true_poles(TRUTH, KNOWN)
    rotor, _, _ = judge.pole_errors(true * np.where(np.arange(8) < 2, 1.1, 1.0), true)
    assert rotor == pytest.approx(10.0, abs=0.01)


def test_intervals_of_poles_are_counted_if_the_model_has_them() -> None:
    true = judge.true_poles(TRUTH, KNOWN)
    std = np.where(np.abs(true.imag) > 1e-6, 0.1, 0.0)
    good = np.column_stack([true.real + 0.05, true.imag, np.full(8, 0.1), std])
    assert judge.poles_covered(good, true) == (12, 12)
    none = np.column_stack([true.real + 0.05, true.imag + 0.05, np.full((8, 2), 1e-3)])
    assert judge.poles_covered(none, true) == (0, 16)


def test_a_ramp_is_averaged_over_the_interval_or_around_the_instant() -> None:
    v = np.repeat(np.arange(100.0)[:, None], 2, axis=1)
    y = np.repeat(np.arange(100.0)[:, None], 3, axis=1)
    u, picked = sampling.held_means(v, y, 10)
    np.testing.assert_allclose(u[:, 0], 4.5 + 10 * np.arange(10))
    np.testing.assert_allclose(picked[:, 0], 10 * np.arange(10))
    u, picked = sampling.node_means(v, y, 10)
    np.testing.assert_allclose(u[1:, 0], 10 * np.arange(1, 9) - 0.5)
    assert len(picked) == len(u)


def test_the_true_rig_differs_from_its_profile() -> None:
    off = np.abs(flights.nominal() / TRUTH - 1)
    assert off.min() > 0.04


def test_the_grey_boxs_parameters_are_read_by_name() -> None:
    given = [{"parameter": n, "value": i + 1.0, "std": 0.1} for i, n in enumerate(
        ours.PHYSICAL[name] for name in rigid.NAMES)]  # fmt: skip
    values, stds = ours.ten_parameters(given[:-1])
    np.testing.assert_array_equal(values, [*range(1, 10), 0.0])
    assert np.isnan(stds[-1])
    by_name = {p["parameter"]: {"value": p["value"]} for p in given}
    np.testing.assert_array_equal(ours.ten_parameters(by_name)[0], np.arange(1.0, 11.0))


def test_a_missing_peer_is_skipped_with_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    octave = next(t for t in tools.TOOLS if t.module == "octave_n4sid")
    monkeypatch.setattr(tools, "PEERS_PYTHON", ROOT / "nowhere")
    assert "make bench-peers" in octave.missing()
    monkeypatch.setattr(tools, "PEERS_PYTHON", ROOT)
    monkeypatch.setattr(tools.shutil, "which", lambda name: None)
    assert "apt install octave octave-control" in octave.missing()
    row = bench_peers.table("steps", [], [""] * (len(bench_peers.HEAD) - 1)).rows
    assert any("Octave is not installed here" in cell for line in row for cell in line)


def test_every_peer_is_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pins = (ROOT / "constraints-peers.txt").read_text(encoding="utf-8")
    names = [re.split(r"[<>=~!]", p)[0] for p in project["optional-dependencies"]["peers"]]
    assert names
    for name in names:
        assert re.search(rf"^{name}==\S+$", pins, re.MULTILINE), name
        assert name not in str(project["dependencies"])


def test_slow_topics_exist() -> None:
    assert set(SLOW) <= set(topics())


def test_peak_memory_is_read_from_the_status_page() -> None:
    assert interface.peak_MB("Name: x\nVmHWM:\t   2048 kB\n") == 2.0
    assert np.isnan(interface.peak_MB("Name: x\n"))

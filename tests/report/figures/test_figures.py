from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.comparison.compare import compare
from heli3dof.errors import OutputExists, UsageError
from heli3dof.recording.recording import recording_of_arrays
from heli3dof.report.figures.comparison import axis_figures, comparison_figure, comparison_figures
from heli3dof.report.figures.flight import flight_figure
from heli3dof.report.figures.labelled_curves import Curve, angle_figure, spread
from heli3dof.report.figures.models import BodeCurve, autocorrelation, bode_figure, residual_figure
from heli3dof.report.figures.style import (
    EXPERIMENT,
    HOVER,
    IDENTIFIED,
    drawn,
    model_lines,
    save,
    to_svg,
)
from heli3dof.rig.profile import default_profile
from tests.comparison.fakes import FakeHover, flight

IDENTIFIED_MODEL = FakeHover(name="identification", kind="statespace", thrust=0.9)


@pytest.fixture(scope="module")
def compared():  # type: ignore[no-untyped-def]
    recording = flight(truth=FakeHover(thrust=0.9), noise_deg=0.05)
    return compare([recording], [FakeHover(), IDENTIFIED_MODEL]).flights[0]


def lines_of(figure) -> dict[str, np.ndarray]:  # type: ignore[no-untyped-def]
    """The labels at the right edge, in the figure's first axes, by name."""
    return {t.get_text(): t.get_position() for t in figure.axes[0].texts}


def test_figures_7_to_9_show_reference_experiment_and_every_model(compared) -> None:  # type: ignore[no-untyped-def]
    figures = axis_figures(compared)
    assert list(figures) == ["roll", "pitch", "yaw"]
    for number, (axis, figure) in zip((7, 8, 9), figures.items(), strict=True):
        assert set(lines_of(figure)) == {"reference", "experiment", "hover", "identification"}
        title = figure.texts[0].get_text()
        assert title.startswith(f"{axis.capitalize()} in closed loop")
        assert title.endswith(f"(the paper's Figure {number})")


def test_the_subtitle_gives_the_peaks(compared) -> None:  # type: ignore[no-untyped-def]
    text = comparison_figure(compared, "roll").texts[1].get_text().replace("\u00a0", " ")
    experiment = compared.experiment["roll"].reported.peak_deg
    difference = compared.difference(compared.models[0], "roll")["peak_deg"]
    assert f"experiment {experiment:.1f}°" in text
    assert f"({difference:+.1f}°)".replace("-", "−") in text


def test_the_same_data_give_the_same_svg_and_png(compared) -> None:  # type: ignore[no-untyped-def]
    once, again = (comparison_figure(compared, "roll") for _ in range(2))
    text = to_svg(once)
    assert text == to_svg(again)
    assert drawn(once, ".png") == drawn(again, ".png")
    assert "<dc:date>" not in text


def test_a_diverged_model_gets_a_cross_inside_the_axes() -> None:
    printed = FakeHover(name="hover-printed", kind="hover_printed", yaw_sign=+1.0)
    recording = flight(yaw_deg=5.0, duration_s=12.0)
    result = compare([recording], [printed], horizons_s=()).flights[0]
    axes = comparison_figure(result, "yaw").axes[0]
    assert any(line.get_marker() == "x" for line in axes.lines)
    low, high = axes.get_ylim()
    assert high - low < 60  # the experiment moves within about 6°, the model through 720°


def test_an_unknown_controller_shows_windows_that_start_at_the_data() -> None:
    profile = default_profile().model_copy(update={"controller": None})
    recording = flight(duration_s=12.0, truth=FakeHover(thrust=0.9))
    log = recording_of_arrays(
        recording.t, recording.voltage, recording.angle, profile, meta={"name": "log"}
    )
    figure = comparison_figure(compare([log], [FakeHover()]).flights[0], "roll")
    assert "Roll predictions" in figure.texts[0].get_text()
    dots = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert dots[0].get_xdata() == pytest.approx([0, 3, 6, 9])


def test_an_axis_that_was_not_recorded_has_no_panel_and_no_figure() -> None:
    t = np.arange(0, 4, 0.01)
    angle = np.column_stack([np.sin(t), *[np.full_like(t, np.nan)] * 2])
    log = recording_of_arrays(t, np.zeros((len(t), 2)), angle, default_profile())
    assert len(flight_figure(log).axes) == 2
    assert list(axis_figures(compare([log], [FakeHover()]).flights[0])) == ["roll"]


def test_single_counts_of_an_axis_at_rest_do_not_fill_the_axes() -> None:
    t = np.arange(0, 1, 0.01)
    tiny = Curve("experiment", t, 1e-15 * np.sin(9 * t), EXPERIMENT)
    low, high = angle_figure([tiny], title="", subtitle="", ylabel="p (°)").axes[0].get_ylim()
    assert high - low >= 2.0


def test_the_hover_models_keep_their_colours_among_other_models() -> None:
    assert model_lines(["statespace", "hover", "tf4"])[1] is HOVER
    assert model_lines(["hover"])[0] is HOVER
    assert model_lines(["statespace", "hover", "tf4"])[2] is IDENTIFIED[1]


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8), st.floats(0.01, 0.12))
def test_labels_keep_their_order_and_their_distance(ends: list[float], gap: float) -> None:
    places = spread(np.sort(ends), gap)
    assert (np.diff(places) >= gap - 1e-9).all()
    assert places.min() >= -1e-9
    assert places.max() <= 1 + 1e-9


def test_a_figure_never_overwrites_another_without_force(tmp_path: Path, compared) -> None:  # type: ignore[no-untyped-def]
    figure = comparison_figure(compared, "roll")
    path = save(figure, tmp_path / "new" / "figure.svg")
    with pytest.raises(OutputExists):
        save(figure, path)
    save(figure, path, force=True)
    with pytest.raises(UsageError, match=r"figure\.svg"):
        save(figure, tmp_path / "figure.gif")


def test_bode_curves_of_an_integrator_fall_20_db_a_decade_from_minus_90_degrees() -> None:
    omega = np.geomspace(0.1, 10, 50)
    curve = BodeCurve("hover", "hover", 1 / (1j * omega), 0.1 / omega)
    magnitude, phase = bode_figure(omega, {"roll": [curve]}, title="t").axes
    db = magnitude.lines[0].get_ydata()
    assert db[0] == pytest.approx(20.0)
    assert db[-1] == pytest.approx(-20.0)
    assert phase.lines[0].get_ydata() == pytest.approx(np.full(50, -90.0))
    assert len(magnitude.collections) == 1  # the band


def test_a_lag_one_residual_leaves_the_white_band_and_a_white_one_does_not() -> None:
    e = np.random.default_rng(7).normal(size=20000)
    lags, r, bound = autocorrelation(e, 0.002)
    assert lags[-1] == pytest.approx(0.5)
    assert np.mean(abs(r[1:]) > bound) < 0.03
    coloured = e[1:] + 0.5 * e[:-1]
    assert autocorrelation(coloured, 0.002)[1][1] == pytest.approx(0.4, abs=0.03)  # θ/(1 + θ²)


def test_residuals_of_the_measured_axes_only_are_drawn() -> None:
    t = np.arange(0, 2, 0.01)
    e = np.random.default_rng(1).normal(size=(len(t), 3)) * 1e-3
    e[:, 2] = np.nan
    assert len(residual_figure(t, e).axes) == 4


def test_importing_the_figures_does_not_import_matplotlib() -> None:
    code = (
        "import sys, heli3dof.report.pages.flight_report, heli3dof.report.text.comparison_tables; "
        "sys.exit('matplotlib' in sys.modules or 'rich' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_name_with_dollar_signs_or_hundreds_of_characters_is_drawn_as_text() -> None:
    recording = flight(duration_s=1.0, name=r"cost $\frac{ $5" + 200 * "x")
    model = FakeHover(name="a$_b$" + 60 * "y", kind="statespace")
    figure = comparison_figure(compare([recording], [model]).flights[0], "roll")
    assert to_svg(figure)
    assert all(len(t.get_text()) < 25 for t in figure.axes[0].texts)
    omega = np.geomspace(0.1, 10, 5)
    curve = BodeCurve(model.name, "statespace", 1 / (1j * omega))
    assert to_svg(bode_figure(omega, {"roll": [curve]}, title="$"))


def test_the_figures_of_a_comparison_are_found_by_recording_and_axis() -> None:
    result = compare([flight(duration_s=1.0, name="a")] * 2, [FakeHover()])
    figures = comparison_figures(result)
    assert list(figures) == ["a", "a (2)"]
    assert list(figures["a"]) == ["roll", "pitch", "yaw"]


def test_plot_draws_one_figure_and_names_the_recordings_there_are() -> None:
    result = compare([flight(duration_s=1.0, name="a")], [FakeHover()])
    assert "Pitch in closed loop" in result.plot(axis="pitch").texts[0].get_text()
    with pytest.raises(UsageError, match="no figure of roll of b") as caught:
        result.plot(recording="b")
    assert "recordings: a" in caught.value.fix
    assert flight(duration_s=1.0, name="a").plot().texts[0].get_text() == "Flight · a"

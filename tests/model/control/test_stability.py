"""A gain that does not stabilise the model is refused, and the refusal names the pole."""

from __future__ import annotations

import pytest

from heli3dof.errors import UnstableLoop
from heli3dof.model.control.stability import check_hover_loop, check_loop
from heli3dof.model.linear.hover import hover_model
from heli3dof.paper.eq17 import paper17_model
from tests.model.examples import PROFILE, SPEC, in_another_basis

DT = PROFILE.dt


def test_the_papers_gain_on_the_corrected_model_is_let_through() -> None:
    poles = check_loop(hover_model(PROFILE), SPEC, DT)
    assert poles[0].real == pytest.approx(-0.100, abs=5e-4)


def test_a_profile_without_a_gain_is_checked_with_the_default_gain() -> None:
    bare = PROFILE.model_copy(update={"controller": None})
    assert list(check_hover_loop(bare)) == list(check_loop(hover_model(PROFILE), SPEC, DT))


def test_the_printed_model_is_refused_for_its_pole_at_1_469() -> None:
    with pytest.raises(UnstableLoop, match=r"\+1\.469 rad/s") as caught:
        check_loop(hover_model(PROFILE, printed=True), SPEC, DT)
    assert caught.value.exit_code == 6
    assert "E3" in caught.value.cause
    assert caught.value.fix


def test_equation_17_is_refused_in_both_readings_and_called_defective() -> None:
    for corrected in (False, True):
        with pytest.raises(UnstableLoop, match=r"poles .* rad/s are not left of zero") as caught:
            check_loop(paper17_model(PROFILE, corrected=corrected), SPEC, DT)
        assert "E14" in caught.value.cause


def test_a_gain_with_its_sign_turned_is_refused() -> None:
    turned = SPEC.model_copy(update={"K": tuple(tuple(-k for k in row) for row in SPEC.K)})
    with pytest.raises(UnstableLoop):
        check_loop(hover_model(PROFILE), turned, DT)


def test_a_gain_that_leaves_yaw_free_is_refused_as_not_stabilising() -> None:
    free = tuple((*row[:2], 0.0, *row[3:5], 0.0, row[6], 0.0) for row in SPEC.K)
    with pytest.raises(UnstableLoop, match="not left of zero"):
        check_loop(hover_model(PROFILE), SPEC.model_copy(update={"K": free}), DT)


def test_a_loop_that_runs_too_slowly_is_refused_though_the_ideal_one_is_stable() -> None:
    with pytest.raises(UnstableLoop, match="at 2 Hz") as caught:
        check_loop(hover_model(PROFILE), SPEC, 0.5)
    assert "rate_hz" in caught.value.fix


def test_a_model_in_any_basis_is_checked_as_it_flies() -> None:
    check_loop(in_another_basis(hover_model(PROFILE)), SPEC, DT)
    with pytest.raises(UnstableLoop, match=r"\+1\.4"):
        check_loop(in_another_basis(hover_model(PROFILE, printed=True)), SPEC, DT)

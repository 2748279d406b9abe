"""An inertia that is off is tied with causes that a base would take for it and leave no trace."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.calibration import Off
from heli3dof.diagnosis.imitated import imitators, look_beside, with_imitators
from heli3dof.model.effects import term
from heli3dof.rig.profile import default_profile


def step(imitated: float, v: float, Z: float, ratio: float = 1.4) -> Any:
    """A look with one probe, of the thrust curve's typical size, that the base imitates by so much
    of ln J_roll, with information v, at which the recording shows Z."""
    curve = term("motor.thrust_curve")
    values = np.array([1.0, ratio, 1.0, 1.0])
    free = [SimpleNamespace(start=1.0, unit="kg·m²", inward=np.log)] * 4
    probe = SimpleNamespace(
        term=curve, name=curve.name, grows=True, size=curve.effect.parameters[0].typical,
        values=(0.0,),
    )  # fmt: skip
    found = SimpleNamespace(
        free=free, values=values, std=0.001 * values,
        structure=SimpleNamespace(profile=default_profile()),
    )  # fmt: skip
    screen = SimpleNamespace(
        plain=(probe,), solved=np.array([[0.0], [imitated], [0.0], [0.0]]), v=np.array([v])
    )
    nulls = SimpleNamespace(std=np.ones(1), judged=lambda seen: np.array([Z]))
    return cast(
        Any,
        SimpleNamespace(found=found, screen=screen, nulls=nulls, seen=None, instead_of_inertia=[]),
    )


def test_what_takes_the_inertia_to_its_edge_and_shows_nothing_is_tied_with_it() -> None:
    # ln 1.4 − ln 1.15 ≈ 0.2 (K_f takes a little), a tenth for each typical size: two of them.
    assert imitators(step(0.1, v=0.01, Z=0.0), 1) == ("motor.thrust_curve",)


@pytest.mark.parametrize(("imitated", "v", "Z"), [(0.001, 0.01, 0.0), (0.1, 100.0, 0.0)])
def test_one_that_would_have_to_be_huge_or_would_show_is_not(
    imitated: float, v: float, Z: float
) -> None:
    assert imitators(step(imitated, v, Z), 1) == ()


def test_one_that_does_show_as_it_would_is_tied() -> None:
    # Two typical sizes at √v = 10 show Z = 20.
    shown = (np.log(1.4) - np.log(1.15)) / 0.1 * 10
    assert imitators(step(0.1, v=100.0, Z=float(shown)), 1) == ("motor.thrust_curve",)


def test_one_that_shows_more_is_tied_up_to_where_the_inertia_would_be_too_small() -> None:
    # ln 1.4 − ln 0.85 ≈ 0.5, five typical sizes at √v = 10: they show Z = 50.
    assert imitators(step(0.1, v=100.0, Z=45.0), 1) == ("motor.thrust_curve",)
    assert imitators(step(0.1, v=100.0, Z=60.0), 1) == ()
    assert imitators(step(0.1, v=100.0, Z=-20.0), 1) == ()


def slower(share: float, v: float, Z: float) -> Any:
    """A look at a base whose four numbers are all 1.6 times nominal, so that K_f is low by as much,
    with a dead zone of 1 V as the probe, which takes ``share`` off the logarithm of each."""
    dead = term("motor.dead_zone")
    values = np.full(4, 1.6)
    free = [SimpleNamespace(start=1.0, unit="N·m", inward=np.log, outward=np.exp)] * 4
    probe = SimpleNamespace(term=dead, name=dead.name, grows=True, size=1.0, values=(1.0,))
    found = SimpleNamespace(
        free=free, values=values, std=0.001 * values,
        structure=SimpleNamespace(profile=default_profile(), terms=()),
    )  # fmt: skip
    screen = SimpleNamespace(plain=(probe,), solved=np.full((4, 1), share), v=np.array([v]))
    nulls = SimpleNamespace(std=np.ones(1), judged=lambda seen: np.array([Z]))
    return cast(Any, SimpleNamespace(found=found, screen=screen, nulls=nulls, seen=None))


LOW = Off(term("motor.thrust_gain"), 1 / 1.6, 0.03, 200.0)


def test_a_thrust_gain_is_tied_with_what_moves_all_of_the_base_by_one_factor() -> None:
    # ln 1.6 − ln(1/0.85) = 0.31 to go: at 0.25 for each volt 1.23 V, and √v = 6 shows Z = 7.4.
    assert with_imitators(LOW, slower(0.25, 36.0, 7.4)).tied_with == ("motor.dead_zone",)


@pytest.mark.parametrize(
    ("share", "v", "Z"),
    [
        (0.25, 36.0, 0.0),  # it is not there
        (0.25, 36.0, 20.0),  # more of it is, beside a K_f that is off
        (0.01, 0.01, 0.0),  # it would have to be huge
        (-0.25, 0.01, 0.0),  # less than none of it would be needed
    ],
)
def test_and_else_with_nothing(share: float, v: float, Z: float) -> None:
    assert with_imitators(LOW, slower(share, v, Z)).tied_with == ()


def test_an_inertia_has_its_own_imitators() -> None:
    off = Off(term("inertia.roll"), 1.4, 0.03, 200.0)
    assert with_imitators(off, step(0.1, 0.01, 0.0)).tied_with == ("motor.thrust_curve",)


def test_the_look_beside_the_causes_that_are_left_is_the_one_that_counts() -> None:
    def beside(*names: str) -> Any:
        terms = tuple(term(n) for n in names)
        return SimpleNamespace(found=SimpleNamespace(structure=SimpleNamespace(terms=terms)))

    looks = [beside(), beside("motor.lag"), beside("motor.lag", "motor.dead_zone")]
    assert look_beside(looks, beside("motor.lag").found) is looks[1]
    assert look_beside(looks, beside("motor.delay").found) is looks[2]

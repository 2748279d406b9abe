"""A bound on work holds on a slow machine too, and more work breaks it on any."""

from __future__ import annotations

import pytest

from tests import pace
from tests.pace import Y_S, counted, slower, timed


class SlowMachine:
    """A machine on which all work takes so many times as long, and nothing else has a part in it:
    the yardstick takes `Y_S` times that."""

    def __init__(self, times: float) -> None:
        self.times = times

    def __call__(self) -> float:
        return self.times * worked[0]


worked = [0.0]


@pytest.fixture(autouse=True)
def a_machine_of_our_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """A real one's pace changes from one second to the next."""

    def yardstick() -> None:
        worked[0] += Y_S

    monkeypatch.setattr(pace, "yardstick", yardstick)


def thrice() -> None:
    for _ in range(3):
        pace.yardstick()


@pytest.mark.parametrize("times", [20.0, 80.0])
def test_work_costs_the_same_on_a_slower_machine(times: float) -> None:
    assert timed(thrice, clock=SlowMachine(times)) == pytest.approx(3 * Y_S, rel=0.4)


def test_a_faster_machine_is_not_allowed_more_work() -> None:
    assert timed(thrice, clock=SlowMachine(0.01)) < 0.3 * Y_S
    assert slower(clock=SlowMachine(0.01)) == 1.0


def test_a_slower_machine_is_slower_by_as_much() -> None:
    there, here = slower(clock=SlowMachine(20.0)), slower(clock=SlowMachine(60.0))
    assert here == pytest.approx(3 * there, rel=0.4)


def test_what_is_counted_is_the_same_every_time() -> None:
    def some(n: int) -> None:
        for k in range(n):
            abs(k)

    one, two, three = (counted(lambda n=n: some(n)) for n in (10, 10, 20))
    assert one == two
    assert three.calls - two.calls == 10, "functions of C are called too"
    assert three.instructions - two.instructions >= 10 * 5

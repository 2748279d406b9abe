"""The measured cost does not depend on the machine's speed and grows with the work."""

from __future__ import annotations

import pytest

from tests import pace
from tests.pace import Y_S, counted, slower, timed


class SlowMachine:
    """The clock of a machine on which all work, the yardstick included, takes ``times`` as long."""

    def __init__(self, times: float) -> None:
        self.times = times

    def __call__(self) -> float:
        return self.times * worked[0]


worked = [0.0]


@pytest.fixture(autouse=True)
def simulated_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replaces the yardstick: the speed of a real machine changes within seconds."""

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


def test_slower_is_proportional_to_the_machines_slowness() -> None:
    there, here = slower(clock=SlowMachine(20.0)), slower(clock=SlowMachine(60.0))
    assert here == pytest.approx(3 * there, rel=0.4)


def test_counts_are_reproducible_and_proportional_to_the_work() -> None:
    def some(n: int) -> None:
        for k in range(n):
            abs(k)

    one, two, three = (counted(lambda n=n: some(n)) for n in (10, 10, 20))
    assert one == two
    assert three.calls - two.calls == 10, "calls of C functions count"
    assert three.instructions - two.instructions >= 10 * 5

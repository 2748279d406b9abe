"""Cases of the third plant: a class and a seed draw the effects' names, their flights, the truth.

In a class of single effects, the seeds go through shuffled decks of all effects, as in `cases`.
Plan (where a class has several) and ``known`` (the profile has the controller) are drawn as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from heli3dof.recording.recording import Recording
from tests.hidden.cases import Case, Hidden, Truth
from tests.hidden.equivalences import NEVER_SEEN
from tests.hidden.sizes import EFFECTS, axis_of
from tests.hidden.third_plant.draw import WEAK, Flights, draw_flights
from tests.hidden.third_plant.effects import EFFECTS as THIRD
from tests.hidden.third_plant.effects import OUTSIDE

PLANS = ("rich", "rich", "steps", "run-step")
CONTROLLER_KNOWN = 0.75
"""Share of the cases"""
NAMED = tuple(sorted(set(THIRD) - set(OUTSIDE)))
BASE = ("inertia", "mass", "motor.thrust_gain")
COUNTER_ROTATING = "aero.counter_rotation"
"""Name of a reaction torque whose propellers turn in opposite directions"""
UNRATED_VALUES = ("aero.ground_effect", "aero.reaction_torque")
"""Their formulas have other parameters than the contract's"""


@dataclass(frozen=True)
class ThirdClass:
    """``effects`` from ``table`` are hidden in each flight of one of the ``plans``."""

    plans: tuple[str, ...]
    effects: int
    table: tuple[str, ...]
    count: int


THIRD_CLASSES = {
    "third-rich": ThirdClass(("rich",), 1, NAMED, 86),
    "third-steps": ThirdClass(("steps",), 1, NAMED, 43),
    "third-run-step": ThirdClass(("run-step",), 1, NAMED, 43),
    "third-pair": ThirdClass(PLANS, 2, NAMED, 40),
    "third-outside": ThirdClass(PLANS, 1, tuple(OUTSIDE), 20),
    "third-nothing": ThirdClass(PLANS, 0, (), 40),
}


@dataclass(frozen=True)
class ThirdCase(Case):
    """A case of the third plant; its flights are drawn and sized when they are first read."""

    plan_name: str
    known: bool

    @property
    def device(self) -> str:
        return f"third plant, {self.plan_name}, controller {'known' if self.known else 'unknown'}"

    @cached_property
    def flights(self) -> Flights | str:
        names = [h.name for h in self.hidden]
        number = list(THIRD_CLASSES).index(self.group)
        return draw_flights(names, self.plan_name, self.known, (20_261_127, number, self.seed))

    def fly(self) -> Recording | str:
        return self.flights if isinstance(self.flights, str) else self.flights.log

    def holdout(self) -> Recording | None:
        return None if isinstance(self.flights, str) else self.flights.holdout

    def truth(self, recording: Recording) -> Truth:
        """Effects whose signal ratio is below `WEAK` are ``unseen``."""
        assert isinstance(self.flights, Flights)
        names: list[str] = []
        unseen: list[str] = []
        values: dict[str, dict[str, float]] = {}
        for h in self.flights.hidden:
            name = COUNTER_ROTATING if h.more.get("reaction_back") == -1.0 else h.effect.name
            hidden_well = h.ratio < WEAK or name in NEVER_SEEN
            (unseen if hidden_well else names).append(name)
            values[name] = {}
            if name in EFFECTS and name not in UNRATED_VALUES:
                values[name] = {EFFECTS[name].parameter: h.value}
                second = {"periodic_Hz": "frequency_Hz", "weight_at_s": "time_s"}
                values[name] |= {second[k]: v for k, v in h.more.items() if k in second}
        return Truth(tuple(names), tuple(unseen), values)


def draw_third(group: str, seed: int) -> ThirdCase:
    """The case of a class and a seed; the same class and seed always give the same case."""
    number, wanted = list(THIRD_CLASSES).index(group), THIRD_CLASSES[group]
    rng = np.random.default_rng([20_261_125, number, seed])
    names: list[str] = []
    if wanted.effects:
        table = wanted.table
        deck = np.random.default_rng([20_261_126, number, seed // len(table)])
        names.append(table[deck.permutation(len(table))[seed % len(table)]])
    while len(names) < wanted.effects:
        other = str(rng.choice(wanted.table))
        if not alike(names[0], other):
            names.append(other)
    plan, known = str(rng.choice(wanted.plans)), bool(rng.random() < CONTROLLER_KNOWN)
    hidden = tuple(Hidden(name, "", ()) for name in names)
    return ThirdCase(group, seed, hidden, 0, plan_name=plan, known=known)


def alike(a: str, b: str) -> bool:
    """Whether a recording can hardly separate two effects, so that they are not hidden together."""
    family_a, family_b = a.split(".")[0], b.split(".")[0]
    same_axis = axis_of(a) is not None and axis_of(a) == axis_of(b)
    return (
        (family_a == family_b and (family_a in ("encoder", "motor", "aero") or same_axis))
        or (a.startswith(BASE) and b.startswith(BASE))
        or a == b
    )

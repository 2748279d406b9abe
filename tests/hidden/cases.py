"""A case: the effects hidden in one flight, drawn from a class and a seed, and flown.

A class is a plan and a number of hidden effects. Within a class of single effects the seeds go
through shuffled decks of all effects, so that each occurs equally often. The seed also draws the
rest of a case: size, sign, frequency, instant, noise, and the rig's parameters within ± 7 %.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from heli3dof.experiment.fly import Flight, fly_plan
from heli3dof.experiment.plan import Plan, load_plan, step_plan
from heli3dof.recording.recording import Recording
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import Profile, default_profile
from tests.hidden.equivalences import NEVER_SEEN, UNRATED
from tests.hidden.sizes import EFFECTS, OUTSIDE, RATIO, SIGN, SIZES, Effect

SPREAD = 0.07
SHOWN = ("name", "format", "source", "plan", "outcome", "outcome_details")
"""Keys of a recording's meta that the diagnosis gets. The device's URL would reveal the effect."""
FLOWN_AT_LEAST_S = 20.0


@dataclass(frozen=True)
class Class:
    """``effects`` from ``table`` are hidden in each flight, each at one of these ``sizes``."""

    plan: str
    effects: int
    sizes: tuple[str, ...]
    table: Mapping[str, Effect]
    count: int
    coloured: bool = False
    """The random torques are correlated over a time that each case draws from `NOISE_S`"""


CLASSES = {
    "rich-small": Class("rich", 1, ("small",), EFFECTS, 45),
    "rich-medium": Class("rich", 1, ("medium",), EFFECTS, 90),
    "rich-large": Class("rich", 1, ("large",), EFFECTS, 90),
    "steps-single": Class("steps", 1, ("medium", "large"), EFFECTS, 45),
    "run-step-single": Class("run-step", 1, ("medium", "large"), EFFECTS, 45),
    "rich-pair": Class("rich", 2, ("medium", "large"), EFFECTS, 60),
    "rich-outside": Class("rich", 1, ("medium", "large"), OUTSIDE, 24),
    "steps-outside": Class("steps", 1, ("medium", "large"), OUTSIDE, 12),
    "rich-nothing": Class("rich", 0, (), {}, 100),
    "steps-nothing": Class("steps", 0, (), {}, 100),
    "run-step-nothing": Class("run-step", 0, (), {}, 100),
    "rich-three": Class("rich", 3, ("medium", "large"), EFFECTS, 30),
    "run-step-coloured": Class("run-step", 1, ("medium", "large"), EFFECTS, 90, coloured=True),
    "rich-coloured-nothing": Class("rich", 0, (), {}, 100, coloured=True),
    "steps-coloured-nothing": Class("steps", 0, (), {}, 100, coloured=True),
    "run-step-coloured-nothing": Class("run-step", 0, (), {}, 100, coloured=True),
}
NOISE_S = (0.01, 1.0)
"""s, range of a drawn correlation time of the random torques; drawn log-uniformly"""

NOT_IN_PAIRS = {*NEVER_SEEN, *UNRATED, "motor.thrust_gain"}
"""Effects that cannot be judged by name together with another hidden effect."""


@dataclass(frozen=True)
class Hidden:
    """One effect with its values for the emulated rig."""

    name: str
    size: str
    values: tuple[float, ...]

    @property
    def text(self) -> str:
        return f"{self.name}:{'@'.join(f'{v:.9g}' for v in self.values)}"


@dataclass(frozen=True)
class Case:
    """A flight with its hidden effects. `draw` makes it from the class and the seed only."""

    group: str
    seed: int
    hidden: tuple[Hidden, ...]
    rig_seed: int
    noise_s: float | None = field(default=None, kw_only=True)
    """Correlation time of the random torques in s; None: the emulated rig's own"""

    @property
    def name(self) -> str:
        return f"{self.group}-{self.seed}"

    @property
    def plan(self) -> Plan:
        return plan_named(CLASSES[self.group].plan)

    @property
    def profile(self) -> Profile:
        return default_profile()

    @property
    def device(self) -> str:
        hide = ",".join(h.text for h in self.hidden)
        url = f"mock:?speed=max&spread={SPREAD:g}&seed={self.rig_seed}"
        url += f"&noise_s={self.noise_s:.3g}" if self.noise_s is not None else ""
        return url + (f"&hide={hide}" if hide else "")

    def fly(self) -> Recording | str:
        """The whole flight, or why it was not flown to its end."""
        flight = fly(self)
        if flight.outcome.ending != "completed":
            return f"{flight.outcome.ending}: {flight.outcome.detail}"
        return flight.recording

    def holdout(self) -> Recording | None:
        """A further flight of the same rig, held out from the fit; None: there is none."""
        return None

    def truth(self, recording: Recording) -> Truth:
        """See `truth_of`."""
        return truth_of(self, recording)


def plan_named(name: str) -> Plan:
    """A built-in plan, or ``run-step``: the plan of `heli3dof run-step --roll 10`."""
    return step_plan((10.0, None, None)) if name == "run-step" else load_plan(name)


def draw(group: str, seed: int) -> Case:
    """The case of a class and a seed; the same class and seed always give the same case."""
    number = list(CLASSES).index(group)
    rng = np.random.default_rng([20_261_121, number, seed])
    wanted = CLASSES[group]
    hidden = tuple(
        drawn_effect(wanted.table[name], str(rng.choice(wanted.sizes)), wanted.plan, rng)
        for name in drawn_names(wanted, number, seed, rng)
    )
    rig_seed = int(rng.integers(2**31))
    noise_s = float(np.exp(rng.uniform(*np.log(NOISE_S)))) if wanted.coloured else None
    return Case(group, seed, hidden, rig_seed, noise_s=noise_s)


def drawn_names(wanted: Class, number: int, seed: int, rng: np.random.Generator) -> list[str]:
    """The names of the effects in the case of that seed."""
    names = sorted(wanted.table)
    if wanted.effects > 1:
        allowed = [n for n in names if n not in NOT_IN_PAIRS]
        return [str(n) for n in rng.choice(allowed, wanted.effects, replace=False)]
    if not wanted.effects:
        return []
    deck = np.random.default_rng([20_261_122, number, seed // len(names)]).permutation(len(names))
    return [names[deck[seed % len(names)]]]


def drawn_effect(effect: Effect, size: str, plan: str, rng: np.random.Generator) -> Hidden:
    """The effect at that size, with its sign and its second value drawn."""
    value = effect.sizes[SIZES.index(size)]
    turned = bool(rng.random() < 0.5)
    if turned and effect.way == SIGN:
        value = -value
    if turned and effect.way == RATIO:
        value = 1 / value
    values: tuple[float, ...] = (value,)
    if effect.name.startswith("disturbance.periodic"):
        values = (value, round(float(np.exp(rng.uniform(np.log(0.2), np.log(3.0)))), 4))
    if effect.name == "mass.change":
        duration_s = plan_named(plan).duration_s
        values = (value, round(float(rng.uniform(0.4, 0.75)) * duration_s, 2))
    if effect.name == "aero.ground_effect":
        values = (value, round(float(rng.uniform(0.07, 0.15)), 3))
    return Hidden(effect.name, size, values)


def fly(case: Case) -> Flight:
    """The whole flight, with the full description of the device in its recording."""
    return fly_plan(case.plan, device=case.device, seed=case.rig_seed % 2**31)


def blind(recording: Recording, name: str = "flight") -> Recording:
    """The recording for the diagnosis: no URL, no seed, no serial number, no command line."""
    kept = {k: v for k, v in recording.meta.items() if k in SHOWN}
    return replace(recording, meta={**kept, "name": name})


@dataclass(frozen=True)
class Truth:
    """The expected findings, in SI units (see `equivalences`).

    ``names``: effects to be named; ``unseen``: hidden effects without a trace in the recording;
    ``values``: by name and the contract's parameter.
    """

    names: tuple[str, ...]
    unseen: tuple[str, ...]
    values: Mapping[str, Mapping[str, float]]


def truth_of(case: Case, recording: Recording) -> Truth:
    """The truth from the case, the emulated rig's own body, and the applied voltages."""
    profile = case.profile
    rig = open_driver(case.device, profile)
    body = rig.truth.body  # type: ignore[attr-defined]
    rig.close()
    J, T_g = _nominal(profile)
    names, unseen, values = [], [], {}
    for h in case.hidden:
        effect = {**EFFECTS, **OUTSIDE}[h.name]
        value = h.values[0]
        seen = h.name not in NEVER_SEEN
        if h.name == "mass.imbalance":
            value = body.T_g - T_g
            seen = abs(value) > profile.tolerance * T_g
        if h.name.startswith("inertia."):
            i = ("roll", "pitch", "yaw").index(h.name.rsplit(".", 1)[-1])
            value = (body.J[i] + body.dJ[i]) / J[i]
            seen = abs(value - 1) > profile.tolerance
        if h.name == "motor.thrust_gain":
            value *= body.K_f / profile.motor.K_f
        if h.name == "motor.saturation":
            seen = bool((np.abs(recording.voltage) > h.values[0]).any())
        (names if seen else unseen).append(h.name)
        values[h.name] = {effect.parameter: value, **_more(h)}
    return Truth(tuple(names), tuple(unseen), values)


def _more(h: Hidden) -> dict[str, float]:
    """The second parameter, if the effect has one."""
    second = {
        "mass.change": "time_s", "aero.ground_effect": "height_m",
        **{f"disturbance.periodic.{a}": "frequency_Hz" for a in ("roll", "pitch", "yaw")},
    }  # fmt: skip
    return {second[h.name]: h.values[1]} if h.name in second else {}


def _nominal(p: Profile) -> tuple[tuple[float, float, float], float]:
    """The profile's level inertias (kg·m²) and gravity torque (N·m), from its point masses."""
    m, g = p.mass, p.geometry
    J_p = (m.m_f + m.m_b) * g.L_h**2
    J_r = m.m_w * g.L_w**2 + (m.m_f + m.m_b) * g.L_a**2
    return (J_r, J_p, J_r + J_p), 2 * g.L_a * p.motor.K_f * p.motor.V_o

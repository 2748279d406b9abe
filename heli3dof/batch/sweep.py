"""Read a sweep: a TOML file that describes many flights of emulated rigs.

::

    plan = "rich"                             # a plan's name or its TOML file
    device = "mock:?speed=max&spread=0.05"    # the emulated rig

    [vary]                                    # every combination of these values
    "hide.friction.coulomb.yaw" = [0, 0.02, 0.04]
    noise = [1, 3]

    [design]                                  # and with each, points in these ranges
    points = 16
    seed = 1
    between."hide.motor.lag" = [0.02, 0.1]

The varied names are options of ``mock:``, or ``hide.EFFECT`` for the size of a hidden effect.
The points are those of a scrambled Sobol sequence. Flight k = 0, 1, … uses the seed k of the
emulated rig, unless ``seed`` is varied.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import numpy as np
from pydantic import Field

from heli3dof.batch.task import Task
from heli3dof.errors import UsageError
from heli3dof.experiment.plan import load_plan
from heli3dof.rig.drivers import check_url, is_private
from heli3dof.rig.profile import Profile
from heli3dof.toml_file import Key, Section, check, read_toml

HIDE = "hide."
Value = float | int | str


class Design(Section):
    points: Annotated[int, Key("number of points")] = Field(gt=0)
    seed: Annotated[int, Key("seed of the scrambling")] = Field(0, ge=0)
    between: Annotated[dict[str, tuple[float, float]], Key("name → [smallest, largest] value")]


class SweepFile(Section):
    plan: Annotated[str, Key("the plan's name or its TOML file")] = "rich"
    device: Annotated[str, Key("the emulated rig's URL")] = "mock:?speed=max"
    vary: Annotated[dict[str, list[Value]], Key("name → values")] = Field(default_factory=dict)
    design: Annotated[Design | None, Key("points in ranges")] = None


def read_sweep(path: Path) -> SweepFile:
    """Return the sweep in a TOML file; raises UsageError that names the faulty key."""
    sweep: SweepFile = check(SweepFile, read_toml(path, "sweep", UsageError), str(path), UsageError)
    if not is_private(sweep.device):
        raise UsageError(
            f"{path}: device = {sweep.device!r} is not an emulated rig.",
            cause="a sweep flies unattended, so it never moves a real rig.",
            fix='device = "mock:?speed=max"',
        )
    twice = {*sweep.vary} & {*(sweep.design.between if sweep.design else ())}
    if twice:
        raise UsageError(
            f"{path}: {min(twice)} stands in [vary] and in [design].",
            cause="a value is either listed or drawn.",
            fix="remove it from one of the two",
        )
    for device, _ in itertools.islice(flights(sweep), 1):
        check_url(device)
    return sweep


def flights(sweep: SweepFile) -> Iterator[tuple[str, dict[str, Value]]]:
    """Yield each flight's emulated rig (its URL) and its values: varied option → value.

    The flights are every combination of the ``vary`` values, at every ``design`` point.
    """
    names = list(sweep.vary)
    number = itertools.count()
    for values in itertools.product(*sweep.vary.values()):
        for point in _points(sweep.design):
            chosen = {**dict(zip(names, values, strict=True)), **point}
            yield _device(sweep.device, {"seed": next(number), **chosen}), chosen


def tasks_of_sweep(path: Path, profile: Profile) -> list[Task]:
    """Return a task for each flight of the sweep in the TOML file ``path``."""
    sweep = read_sweep(path)
    plan = load_plan(sweep.plan).to_dict()
    tasks = []
    for number, (device, varied) in enumerate(flights(sweep)):
        options = {"plan": plan, "device": device, "varied": varied}
        tasks.append(Task.new("run", f"{path.stem}-{number:04d}", options, profile))
    return tasks


def _points(design: Design | None) -> list[dict[str, float]]:
    """Return the design's points, each as option → value; without a design, one empty point."""
    if design is None:
        return [{}]
    from scipy.stats import qmc

    low, high = np.array(list(design.between.values()), dtype=float).T
    sampler = qmc.Sobol(len(low), rng=np.random.default_rng(design.seed))
    exponent = max(0, int(np.ceil(np.log2(design.points))))
    unit = sampler.random_base2(exponent)[: design.points]
    points = low + unit * (high - low)
    return [dict(zip(design.between, p, strict=True)) for p in points.tolist()]


def _device(device: str, options: Mapping[str, Value]) -> str:
    """Return the URL ``device`` with these options; options ``hide.EFFECT`` become one ``hide=``.

    >>> _device("mock:?speed=max&seed=9", {"seed": 3, "hide.motor.lag": 0.1, "noise": 2})
    'mock:?speed=max&seed=3&noise=2&hide=motor.lag:0.1'
    """
    head, _, query = device.partition("?")
    words = dict(word.split("=", 1) for word in query.split("&") if "=" in word)
    hidden = [
        f"{n.removeprefix(HIDE)}:{_text(v)}" for n, v in options.items() if n.startswith(HIDE)
    ]
    words |= {n: _text(v) for n, v in options.items() if not n.startswith(HIDE)}
    if hidden:
        own = words.pop("hide", "")
        words["hide"] = ",".join([own, *hidden] if own else hidden)
    return f"{head}?{'&'.join(f'{n}={v}' for n, v in words.items())}"


def _text(value: Value) -> str:
    text = f"{value:.9g}" if isinstance(value, float) else str(value)
    return quote(text, safe="/:,@")

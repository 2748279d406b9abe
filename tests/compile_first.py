"""``python -m tests.compile_first``: compile the numerical code before the tests' workers need it.

Numba stores compiled functions in the checkout. Without this step, each of the three workers
of a fresh checkout would compile the same functions, which takes half a minute of CPU time.
"""

from __future__ import annotations

from multiprocessing import get_context

import numpy as np

from tests.paths import ROOT


def estimator() -> None:
    """Diagnose ten seconds of a step: base fit, nulls, full fits, gain and torque search."""
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.recording.load import load

    recording = load(ROOT / "recordings" / "step-roll-10.mcap")
    diagnose(recording.between(6.0, 16.0), quick=True)


def other_methods() -> None:
    """Identify a black box and a physical model; predict once as the multi-step fit does."""
    from heli3dof.identification.greybox.freeflight import problem_of
    from heli3dof.identification.identify import identify
    from heli3dof.model.greybox.prediction import NOISE
    from heli3dof.recording.load import load

    recording = load(ROOT / "recordings" / "train-1.mcap").between(6.0, 20.0)
    identify(recording, method="pem", order=4)
    problem = problem_of([recording])
    noise = np.append(NOISE, 0.0)
    problem.errors(problem.start, noise, (1.0,))
    problem.loglik(problem.start, noise)
    identify(recording, terms=("motor.lag",))


def emulator() -> None:
    """Fly a short step on the emulated rig."""
    from heli3dof.experiment.fly import fly_plan
    from heli3dof.experiment.plan import step_plan

    plan = step_plan((5.0, None, None), settle_s=1.0, duration_s=1.0)
    fly_plan(plan, device="mock:?speed=max&start=level", seed=0)


def third_plant() -> None:
    """Fly two seconds on the third plant."""
    from tests.hidden.third_plant import draw, loop

    rng = np.random.default_rng(0)
    rig, own = draw.draw_rig(rng), loop.Loop(500, False, False, False)
    loop.fly(own, draw.draw_task("run-step", 2.0, own, 0, 0.1, rng), rig)


if __name__ == "__main__":
    context = get_context("spawn")
    works = (estimator, other_methods, emulator, third_plant)
    processes = [context.Process(target=work) for work in works]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    raise SystemExit(max(abs(p.exitcode or 0) for p in processes))

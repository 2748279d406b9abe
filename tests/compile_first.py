"""``python -m tests.compile_first``: compile the numerical code before the tests' workers need it.

Numba stores compiled functions in the checkout. Without this step, each of the three workers
of a fresh checkout would compile the same functions, which takes half a minute of CPU time.
"""

from __future__ import annotations

from multiprocessing import get_context

from tests.paths import ROOT


def estimator() -> None:
    """Diagnose ten seconds of a step: base fit, nulls, full fits, gain and torque search."""
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.recording.load import load

    recording = load(ROOT / "recordings" / "step-roll-10.mcap")
    diagnose(recording.between(6.0, 16.0), quick=True)


def emulator() -> None:
    """Fly a short step on the emulated rig."""
    from heli3dof.experiment.fly import fly_plan
    from heli3dof.experiment.plan import step_plan

    plan = step_plan((5.0, None, None), settle_s=1.0, duration_s=1.0)
    fly_plan(plan, device="mock:?speed=max&start=level", seed=0)


def third_plant() -> None:
    """Fly two seconds on the third plant."""
    import numpy as np

    from tests.hidden.third_plant import draw, loop

    rng = np.random.default_rng(0)
    rig, own = draw.draw_rig(rng), loop.Loop(500, False, False, False)
    loop.fly(own, draw.draw_task("run-step", 2.0, own, 0, 0.1, rng), rig)


if __name__ == "__main__":
    context = get_context("spawn")
    processes = [context.Process(target=work) for work in (estimator, emulator)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    raise SystemExit(max(abs(p.exitcode or 0) for p in processes))

"""``python -m tests.hidden.run``: flies and diagnoses cases in parallel; it can be interrupted.

One JSON line per case goes to bench-out/hidden/<key>.jsonl: the truth, the document, the time. The
key is a hash of the judged code and of the code that hides effects, so results of different code
never mix. Cases that are already in the file are skipped. `tests.hidden.tally` judges afterwards,
so a new statistic needs no new flights.

The engines of `heli3dof.batch` do the work: processes, or the Dask cluster that the environment
variable DASK_SCHEDULER_ADDRESS names. Its workers must run in a checkout of the same code.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import resource
import signal
import sys
import time
import traceback
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from heli3dof.batch.engines import Lost, engine
from heli3dof.errors import UsageError
from tests.hidden.cases import CLASSES, blind, draw
from tests.hidden.rig_cases import RIG_CLASSES, draw_on_other_rig
from tests.hidden.third_cases import THIRD_CLASSES, draw_third
from tests.hidden.tools import FLIES, TOOLS, Tool
from tests.paths import ROOT

FOLDER = ROOT / "bench-out" / "hidden"
MOST_MEMORY = 6 << 30
"""Bytes that one diagnosis may use"""
Line = dict[str, Any]
COUNTS = {g: c.count for g, c in {**CLASSES, **RIG_CLASSES}.items()}
COUNTS |= {g: c.count for g, c in THIRD_CLASSES.items()}
"""Class → number of cases"""
DRAWS = {
    **dict.fromkeys(CLASSES, draw), **dict.fromkeys(RIG_CLASSES, draw_on_other_rig),
    **dict.fromkeys(THIRD_CLASSES, draw_third),
}  # fmt: skip


def key(tool: str) -> str:
    """Hash of all files that a result depends on."""
    return _key(tool, TOOLS[tool].code)


def _key(tool: str, code: Iterable[str]) -> str:
    h = hashlib.sha256(tool.encode())
    paths = [ROOT / p for p in {*FLIES, *code}]
    files = {
        f for p in paths for f in (p.rglob("*") if p.is_dir() else [p])
        if f.suffix in (".py", ".toml", ".txt")
    }  # fmt: skip
    for f in sorted(files):
        h.update(str(f.relative_to(ROOT)).encode())
        h.update(f.read_bytes())
    return f"{tool}-{h.hexdigest()[:16]}"


@dataclass(frozen=True)
class Job:
    """One case for a tool. A worker has not registered the tool, so it gets it with the job."""

    group: str
    seed: int
    tool: Tool
    code: str = ""
    """`key` that the worker's code must have; empty on this computer"""

    @property
    def case(self) -> str:
        return f"{self.group}-{self.seed}"


def in_worker(job: Job) -> Line:
    """Do `one` job, with a limit on memory. Raises UsageError if the worker has other code."""
    if job.code and job.code != (mine := _key(job.code.rpartition("-")[0], job.tool.code)):
        raise UsageError(
            f"A worker runs other code than {job.code}: {mine}.",
            cause="its checkout differs from this one.",
            fix="update it and restart the worker",
        )
    # A diagnosis that needs too much memory fails without ending the benchmark.
    most = resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, most))
    return one(job.group, job.seed, job.tool)


def one(group: str, seed: int, tool: Tool) -> Line:
    """Fly a case and run the tool; a failure is a line as well."""
    case = DRAWS[group](group, seed)
    line: Line = {
        "case": case.name, "group": group, "seed": seed, "device": case.device,
        "size": "/".join(h.size for h in case.hidden),
    }  # fmt: skip
    try:
        flown = case.fly()
    except UsageError as error:  # the emulator refuses a size that was scaled to a small rig
        flown = error.what
    if isinstance(flown, str):
        return {**line, "not_flown": flown}
    line["truth"] = json.loads(json.dumps(asdict(case.truth(flown))))
    given, held = [blind(flown)], case.holdout()
    if tool.takes_holdout and held is not None:
        given.append(blind(held, "holdout"))
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        line["document"] = tool.ask(*given)
    except Exception as error:  # a crash is a result of the benchmark
        line["error"] = f"{type(error).__name__}: {error}"
        line["traceback"] = traceback.format_exc()
    line["wall_s"] = round(time.perf_counter() - wall, 2)
    line["cpu_s"] = round(time.process_time() - cpu, 2)
    return line


def lines(path: Path) -> Iterator[Line]:
    """The lines of a file, without a line truncated by an interruption."""
    if not path.exists():
        return
    for text in path.read_text(encoding="utf-8").splitlines():
        try:
            yield json.loads(text)
        except json.JSONDecodeError:
            continue


def wanted(first: int, share: float, only: Iterable[str] = ()) -> list[tuple[str, int]]:
    """(class, seed) of a run: ``share`` of each class's cases, its seeds from ``first`` on.

    The classes alternate, so that an interrupted run has cases of each class.
    """
    groups = list(only) or list(CLASSES)
    counts = {g: max(1, round(share * COUNTS[g])) for g in groups}
    jobs = [((i + 0.5) / n, g, first + i) for g, n in counts.items() for i in range(n)]
    return [(g, seed) for _, g, seed in sorted(jobs)]


def run(
    jobs: Iterable[tuple[str, int]], tool: str, *, processes: int | None, folder: Path = FOLDER
) -> Mapping[str, Line]:
    """Run the cases that are not in the file; returns case → line of all jobs.

    ``processes``: how many; None: one per core, or the cluster in the environment.
    """
    jobs, path = list(jobs), folder / f"{key(tool)}.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    _end_last_line(path)
    done = {line["case"]: line for line in lines(path)}
    todo = [(g, s) for g, s in jobs if f"{g}-{s}" not in done]
    print(f"{path.name}: {len(jobs) - len(todo)} of {len(jobs)} are done", file=sys.stderr)
    start = time.perf_counter()
    before = signal.signal(signal.SIGTERM, _stop)
    try:
        with path.open("a", encoding="utf-8") as out, engine(workers=processes) as used:
            code = path.stem if used.remote else ""
            work = [Job(g, s, TOOLS[tool], code) for g, s in todo]
            with closing(used.run(in_worker, work)) as results:
                for n, (number, line) in enumerate(results, 1):
                    if isinstance(line, Lost):
                        raise RuntimeError(f"{work[number].case}: {line.why}")
                    done[line["case"]] = line
                    out.write(json.dumps(line, ensure_ascii=False) + "\n")
                    out.flush()
                    left = (time.perf_counter() - start) / n * (len(todo) - n)
                    text = f"{n}/{len(todo)}, {left / 60:.1f} min left: {as_text(line)}"
                    print(f"  {text}", file=sys.stderr)
    finally:
        signal.signal(signal.SIGTERM, before)
    names = [f"{g}-{s}" for g, s in jobs]
    return {name: done[name] for name in names}


def _stop(signum: int, frame: object) -> None:
    """Same as Ctrl-C, so that the workers end too; otherwise they would wait for work for ever."""
    raise KeyboardInterrupt


def _end_last_line(path: Path) -> None:
    """End a truncated last line, so that the next line starts on its own."""
    if path.exists() and (text := path.read_bytes()) and not text.endswith(b"\n"):
        with path.open("ab") as out:
            out.write(b"\n")


def as_text(line: Line) -> str:
    """A case in one line of text."""
    from tests.hidden.judge import names

    hidden = ", ".join([*line.get("truth", {}).get("names", ()),
                        *(f"({n})" for n in line.get("truth", {}).get("unseen", ()))])  # fmt: skip
    if "document" not in line:
        return f"{line['case']}: {line.get('not_flown') or line.get('error')}"
    named = ", ".join(names(line["document"])) or "–"
    return f"{line['case']}: {hidden or 'nothing'} → {named} ({line['wall_s']:.0f} s)"


def arguments() -> argparse.Namespace:
    p = argparse.ArgumentParser(prog="python -m tests.hidden.run", description=__doc__)
    p.add_argument("--first", type=int, default=1000, help="first seed (below 1000: final tables)")
    p.add_argument("--share", type=float, default=1.0, help="of each class's number of cases")
    p.add_argument("--only", nargs="*", default=[], choices=list(COUNTS), metavar="CLASS")
    p.add_argument("--tool", default="whole", choices=list(TOOLS))
    p.add_argument("--processes", type=int, help="default: one per core, or a Dask cluster")
    return p.parse_args()


def main() -> None:
    from tests.hidden.tally import summary

    a = arguments()
    done = run(wanted(a.first, a.share, a.only), a.tool, processes=a.processes)
    print(summary(list(done.values())))


if __name__ == "__main__":
    main()

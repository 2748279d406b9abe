"""``python -m tests.hidden.run``: flies and diagnoses case after case, and can be stopped.

One JSON line for each case goes to bench-out/hidden/<key>.jsonl: the truth, the document, the
time. The key is made from the code that is judged and the code that hides, so results of different
code never mix; what stands there already is not done again. Judging happens afterwards
(`tests.hidden.tally`), so another question needs no new flights.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import time
import traceback
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.hidden.cases import CLASSES, blind, draw, fly, truth_of
from tests.paths import ROOT

FOLDER = ROOT / "bench-out" / "hidden"
HIDING = ("sizes.py", "cases.py")
Line = dict[str, Any]


def key(quick: bool) -> str:
    """Of everything that a result depends on."""
    h = hashlib.sha256(b"quick" if quick else b"whole")
    here = Path(__file__).parent
    files = [*(ROOT / "heli3dof").rglob("*.py"), *(ROOT / "heli3dof").rglob("*.toml")]
    for path in sorted([*files, *(ROOT / "drivers").rglob("*.py"), *(here / n for n in HIDING)]):
        h.update(str(path.relative_to(ROOT)).encode())
        h.update(path.read_bytes())
    return h.hexdigest()[:16]


def one(group: str, seed: int, quick: bool) -> Line:
    """Fly a case and diagnose it; what goes wrong is a line as well."""
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.diagnosis.document import document

    case = draw(group, seed)
    line: Line = {
        "case": case.name, "group": group, "seed": seed, "device": case.device,
        "size": "/".join(h.size for h in case.hidden),
    }  # fmt: skip
    flight = fly(case)
    if flight.outcome.ending != "completed":
        return {**line, "not_flown": f"{flight.outcome.ending}: {flight.outcome.detail}"}
    line["truth"] = asdict(truth_of(case, flight.recording))
    recording = blind(flight.recording)
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        line["document"] = json.loads(json.dumps(document(diagnose(recording, quick=quick))))
    except Exception as error:  # a crash is a result of the bench, not its end
        line["error"] = f"{type(error).__name__}: {error}"
        line["traceback"] = traceback.format_exc()
    line["wall_s"] = round(time.perf_counter() - wall, 2)
    line["cpu_s"] = round(time.process_time() - cpu, 2)
    return line


def lines(path: Path) -> Iterator[Line]:
    """What a file holds; a line torn by a stop is left out."""
    if not path.exists():
        return
    for text in path.read_text(encoding="utf-8").splitlines():
        try:
            yield json.loads(text)
        except json.JSONDecodeError:
            continue


def wanted(first: int, share: float, only: Iterable[str] = ()) -> list[tuple[str, int]]:
    """(class, seed) of a run: ``share`` of each class's cases, its seeds from ``first`` on.

    The classes take turns, so that a run that is stopped has seen something of each.
    """
    groups = list(only) or list(CLASSES)
    counts = {g: max(1, round(share * CLASSES[g].count)) for g in groups}
    jobs = [((i + 0.5) / n, g, first + i) for g, n in counts.items() for i in range(n)]
    return [(g, seed) for _, g, seed in sorted(jobs)]


def run(
    jobs: Iterable[tuple[str, int]], path: Path, *, quick: bool, processes: int
) -> Mapping[str, Line]:
    """Do what is not done; returns case → line of all jobs."""
    jobs = list(jobs)
    path.parent.mkdir(parents=True, exist_ok=True)
    _mend(path)
    done = {line["case"]: line for line in lines(path)}
    todo = [(g, s) for g, s in jobs if f"{g}-{s}" not in done]
    print(f"{path.name}: {len(jobs) - len(todo)} of {len(jobs)} are done", file=sys.stderr)
    start = time.perf_counter()
    # One BLAS thread a process: the cores are full already.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with path.open("a", encoding="utf-8") as out, ProcessPoolExecutor(processes) as pool:
        futures = [pool.submit(one, g, s, quick) for g, s in todo]
        try:
            for n, future in enumerate(as_completed(futures), 1):
                line = future.result()
                done[line["case"]] = line
                out.write(json.dumps(line, ensure_ascii=False) + "\n")
                out.flush()
                left = (time.perf_counter() - start) / n * (len(todo) - n)
                print(f"  {n}/{len(todo)}, {left / 60:.1f} min left: {said(line)}", file=sys.stderr)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            raise
    names = [f"{g}-{s}" for g, s in jobs]
    return {name: done[name] for name in names}


def _mend(path: Path) -> None:
    """End a torn last line, so that the next one stands by itself."""
    if path.exists() and (text := path.read_bytes()) and not text.endswith(b"\n"):
        with path.open("ab") as out:
            out.write(b"\n")


def said(line: Line) -> str:
    """A case in one line of text."""
    from tests.hidden.judge import names

    hidden = ", ".join([*line.get("truth", {}).get("names", ()),
                        *(f"({n})" for n in line.get("truth", {}).get("unseen", ()))])  # fmt: skip
    if "document" not in line:
        return f"{line['case']}: {line.get('not_flown') or line.get('error')}"
    found = ", ".join(names(line["document"])) or "–"
    return f"{line['case']}: {hidden or 'nothing'} → {found} ({line['wall_s']:.0f} s)"


def arguments() -> argparse.Namespace:
    p = argparse.ArgumentParser(prog="python -m tests.hidden.run", description=__doc__)
    p.add_argument("--first", type=int, default=1000, help="first seed (below 1000: final tables)")
    p.add_argument("--share", type=float, default=1.0, help="of each class's number of cases")
    p.add_argument("--only", nargs="*", default=[], choices=list(CLASSES), metavar="CLASS")
    p.add_argument("--quick", action="store_true", help="fewer simulated nulls")
    p.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    return p.parse_args()


def main() -> None:
    from tests.hidden.tally import summary

    a = arguments()
    path = FOLDER / f"{key(a.quick)}.jsonl"
    done = run(wanted(a.first, a.share, a.only), path, quick=a.quick, processes=a.processes)
    print(summary(list(done.values())))


if __name__ == "__main__":
    main()

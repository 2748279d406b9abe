"""``python -m tests.bench [topic ...]`` measures, keeps the figures and renders benchmarks.md.

Without a topic it measures all but those in `SLOW`. Each figure is kept with its commit. So in a
tree with changes, new files included, the figures are printed and not kept.
"""

from __future__ import annotations

import importlib
import json
import os
import platform
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

from tests.bench import Figure, Table, page

FOLDER = Path(__file__).parent
ROOT = FOLDER.parent.parent

SLOW = (
    "batch",
    "peers",
    "fleet",
    "hidden",
    "loop",
    "misbehaviour",
    "ramp_down",
    "real_fleet",
    "realtime",
    "rigs",
    "rules",
    "soak",
    "third",
    "unit_costs",
    "watches",
)
"""Topics that take many minutes or need further tools; they run only when named"""


def topics() -> list[str]:
    """Returns the topics, in alphabetical order."""
    return [p.stem.removeprefix("bench_") for p in sorted(FOLDER.glob("bench_*.py"))]


def machine() -> str:
    return f"{os.cpu_count()} cores, Python {platform.python_version()}, {platform.system()}"


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.strip()


def revision() -> str:
    """Returns the commit, or an empty string in a tree with changes or untracked files."""
    commit = _git("describe", "--always") or "not a checkout"
    return "" if _git("status", "--porcelain") else commit


def measure(topic: str, commit: str) -> dict[str, object]:
    """Measure one topic; returns its entry in benchmarks.json."""
    bench = importlib.import_module(f"tests.bench.bench_{topic}")
    start = time.perf_counter()
    measured = bench.measure()
    return {
        "title": bench.TITLE,
        "intro": getattr(bench, "INTRO", ""),
        "command": getattr(bench, "COMMAND", f"make bench TOPIC={topic}"),
        "figures": [asdict(m) for m in measured if isinstance(m, Figure)],
        "tables": [asdict(m) for m in measured if isinstance(m, Table)],
        "revision": commit,
        "machine": machine(),
        "took_s": round(time.perf_counter() - start, 1),
    }


def main(wanted: list[str]) -> None:
    unknown = set(wanted) - set(topics())
    if unknown:
        sys.exit(f"no bench for {', '.join(sorted(unknown))}; topics: {', '.join(topics())}")
    commit = revision()
    store = page.load()
    for topic in wanted or [t for t in topics() if t not in SLOW]:
        print(f"{topic} …", file=sys.stderr, flush=True)
        kept = measure(topic, commit)
        if not kept["figures"]:
            print("  not measured: a tool or the real recordings are missing", file=sys.stderr)
            continue
        for f in kept["figures"]:  # type: ignore[attr-defined]
            print(f"  {f['what']}: {f['value']}  {f['bar']}", file=sys.stderr)
        if not commit:
            continue
        store[topic] = kept
        page.STORE.write_text(
            json.dumps(store, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        page.write(store)
    if not commit:
        print(
            "The figures are not kept, because the tree has changes and each figure is kept with "
            "its commit. To keep them, commit and run it again.",
            file=sys.stderr,
        )


if __name__ == "__main__":
    main(sys.argv[1:])

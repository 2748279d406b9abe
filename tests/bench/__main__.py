"""``python -m tests.bench [topic ...]``: measure, keep the figures, render docs/benchmarks.md.

Without a topic: every one but the slow ones.
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

from tests.bench import Figure, Table

FOLDER = Path(__file__).parent
ROOT = FOLDER.parent.parent
STORE = ROOT / "docs" / "benchmarks.json"
PAGE = ROOT / "docs" / "benchmarks.md"

SLOW = ("peers", "hidden", "loop", "misbehaviour", "ramp_down", "realtime", "soak", "watches")
"""Topics of many minutes, or that need more than our own environment: measured when asked for."""

HEAD = """# Benchmarks

Every figure here was measured by the command beside its title; none is typed by hand. A row
says what was asked for (the bar) where something was, and whether it was met. Seeds are stated;
times are of the machine named under each title, which was shared and noisy.
"""


def topics() -> list[str]:
    """The topics in the order of their files' names."""
    return [p.stem.removeprefix("bench_") for p in sorted(FOLDER.glob("bench_*.py"))]


def machine() -> str:
    return f"{os.cpu_count()} cores, Python {platform.python_version()}, {platform.system()}"


def revision() -> str:
    done = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True
    )
    return done.stdout.strip() or "not a checkout"


def measure(topic: str) -> dict[str, object]:
    """Measure one topic; returns what the store keeps of it."""
    bench = importlib.import_module(f"tests.bench.bench_{topic}")
    start = time.perf_counter()
    measured = bench.measure()
    return {
        "title": bench.TITLE,
        "intro": getattr(bench, "INTRO", ""),
        "command": getattr(bench, "COMMAND", f"make bench TOPIC={topic}"),
        "figures": [asdict(m) for m in measured if isinstance(m, Figure)],
        "tables": [asdict(m) for m in measured if isinstance(m, Table)],
        "revision": revision(),
        "machine": machine(),
        "took_s": round(time.perf_counter() - start, 1),
    }


def render(store: dict[str, dict]) -> str:
    """The page, from the stored figures alone."""
    parts = [HEAD]
    for topic in topics():
        if topic not in store:
            continue
        kept = store[topic]
        parts.append(f"\n## {kept['title']}\n")
        command = kept.get("command", f"make bench TOPIC={topic}")
        parts.append(
            f"`{command}` · {kept['took_s']:g} s · {kept['machine']} · at {kept['revision']}\n"
        )
        if kept["intro"]:
            parts.append("\n" + kept["intro"].strip() + "\n")
        parts += [rendered(table) for table in kept.get("tables", [])]
        if not kept["figures"]:
            continue
        parts.append("\n| what | measured | asked for | met | how |\n|---|---|---|---|---|\n")
        for f in kept["figures"]:
            met = {True: "yes", False: "**no**", None: ""}[f["met"]]
            parts.append(f"| {f['what']} | {f['value']} | {f['bar']} | {met} | {f['how']} |\n")
    return "".join(parts)


def rendered(table: dict) -> str:
    """A stored `Table` as Markdown."""
    lines = [table["head"], ["---"] * len(table["head"]), *table["rows"]]
    rows = "".join("| " + " | ".join(line) + " |\n" for line in lines)
    return f"\n{table['caption']}:\n\n{rows}"


def main(wanted: list[str]) -> None:
    unknown = set(wanted) - set(topics())
    if unknown:
        sys.exit(f"no bench for {', '.join(sorted(unknown))}; there are: {', '.join(topics())}")
    store = json.loads(STORE.read_text(encoding="utf-8")) if STORE.exists() else {}
    for topic in wanted or [t for t in topics() if t not in SLOW]:
        print(f"{topic} …", file=sys.stderr, flush=True)
        kept = measure(topic)
        if not kept["figures"]:
            print("  not measured here: what it needs is absent", file=sys.stderr)
            continue
        store[topic] = kept
        for f in kept["figures"]:  # type: ignore[attr-defined]
            print(f"  {f['what']}: {f['value']}  {f['bar']}", file=sys.stderr)
        STORE.write_text(json.dumps(store, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        PAGE.write_text(render(store), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

"""Runs the commands whose JSON documents and recordings are kept, and reduces their output.

A kept document holds every key, number, boolean and single word of the printed one. Sentences, file
paths and times of day are replaced by a mark, so that their wording may change.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from heli3dof_recordings import references

from heli3dof.recording.mcap_files.reader import read_recording
from tests.cli.running import heli3dof

KEPT = Path(__file__).parent / "documents"
REFERENCES = {r.name: r.path for r in references()}
TEXT, RUN = "<text>", "<differs in every run>"
WORD = re.compile(r"[A-Za-z0-9_.:+-]{1,40}$")
DIFFERS_IN_EVERY_RUN = re.compile(
    r"(^|_)(seconds|elapsed_s|took_s|utc|created|host_time_s|started_s|version|commit|boot|pid)$"
)
MOCK = "mock:?speed=max&seed=7"
HIDDEN = f"{MOCK}&hide=friction.coulomb.yaw:0.03"

COMMANDS: dict[str, tuple[str, ...]] = {
    "run-step": ("run-step", "--roll", "10", "--device", MOCK, "--seed", "7"),
    "run-step-hidden": (
        "run-step", "--yaw", "20", "--duration", "6", "--device", HIDDEN, "--seed", "7",
    ),
    "run-dry": ("run", "rich", "--dry-run", "--device", MOCK),
    "simulate": ("simulate", "steps", "--model", "hover"),
    "simulate-large": ("simulate", "large", "--model", "hover"),
    "identify": ("identify", "{train-1}", "--holdout", "{train-2}"),
    "identify-pem": ("identify", "{train-1}", "--method", "pem", "--holdout", "{train-2}"),
    "compare": ("compare", "{step-roll-10}", "{step-yaw-20}"),
    "diagnose": ("diagnose", "{step-yaw-20}", "--quick", "--seed", "0"),
    "diagnose-linear": ("diagnose", "{step-roll-10}", "--quick", "--base", "hover", "--seed", "0"),
    "info": ("info", "{step-roll-10}"),
    "plans": ("plans",),
    "profile-check": ("profile", "check"),
}  # fmt: skip
RECORDED = {"run-step", "run-step-hidden", "simulate", "simulate-large"}
"""Commands that write a recording, kept as the names, lengths and means of its channels"""
DIAGNOSES = {name for name in COMMANDS if name.startswith("diagnose")}
"""Commands whose numbers another processor may change by more than rounding (see `form`)"""


def words(name: str, folder: Path) -> list[str]:
    """Returns the arguments of one command, with its files in ``folder``."""
    given = [w.format_map(REFERENCES) for w in COMMANDS[name]]
    if name in RECORDED:
        given += ["--output", str(folder / f"{name}.mcap")]
    elif name.startswith(("identify", "diagnose")):
        given += ["--output", str(folder / f"{name}.json")]
    elif name == "compare":
        given += ["--output", str(folder / name)]
    return [*given, "--json"]


def reduced(document: Any, key: str = "") -> Any:
    """Returns the document without the parts that change with wording or from run to run."""
    if DIFFERS_IN_EVERY_RUN.search(key):
        return RUN
    if isinstance(document, dict):
        return {k: reduced(v, k) for k, v in document.items()}
    if isinstance(document, list):
        return [reduced(v, key) for v in document]
    if isinstance(document, str):
        return document if WORD.match(document) else TEXT
    return document


def form(document: Any) -> Any:
    """Returns the document's keys and kinds of values; of a list, the forms that occur in it.

    A diagnosis simulates flights that end in limit cycles of one encoder count. There, another
    processor's rounding becomes 5 % of an error in degrees and 15 % of a score.
    """
    if isinstance(document, dict):
        return {k: form(v) for k, v in document.items()}
    if isinstance(document, list):
        forms = [form(v) for v in document]
        return [f for i, f in enumerate(forms) if f not in forms[:i]]
    return "number" if _are_numbers(document) else type(document).__name__


def differences(kept: Any, now: Any, share: float, at: str = "") -> Iterator[str]:
    """Yields where two reduced documents differ: keys, lengths, words or numbers.

    Numbers a, b differ if |a − b| > share·(1 + max(|a|, |b|)): with a share of 1 %, an error of
    0.01° that becomes 0.02° is no difference.
    """
    if isinstance(kept, dict) and isinstance(now, dict):
        yield from (f"{at}.{k}: gone" for k in kept.keys() - now.keys())
        yield from (f"{at}.{k}: new" for k in now.keys() - kept.keys())
        for k in kept.keys() & now.keys():
            yield from differences(kept[k], now[k], share, f"{at}.{k}")
    elif isinstance(kept, list) and isinstance(now, list):
        if len(kept) != len(now):
            yield f"{at}: {len(kept)} items before, {len(now)} now"
        for i, (a, b) in enumerate(zip(kept, now, strict=False)):
            yield from differences(a, b, share, f"{at}[{i}]")
    elif _are_numbers(kept, now):
        if abs(kept - now) > share * (1 + max(abs(kept), abs(now))):
            yield f"{at}: {kept} before, {now} now"
    elif kept != now and RUN not in (kept, now):
        yield f"{at}: {kept!r} before, {now!r} now"


def _are_numbers(*values: Any) -> bool:
    return all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)


def recorded(path: Path) -> dict[str, Any]:
    """Returns length, mean and mean square of each channel, and the keys of the metadata."""
    recording = read_recording(path)
    columns = {
        "t": recording.t, "angle": recording.angle, "voltage": recording.voltage,
        "reference": recording.reference, **recording.channels,
    }  # fmt: skip
    about = {
        name: [int(v.size), float(v.astype(float).mean()), float((v.astype(float) ** 2).mean())]
        for name, v in columns.items()
        if v is not None and not DIFFERS_IN_EVERY_RUN.search(name)
    }
    return {"channels": about, "meta": sorted(recording.meta)}


def documents(names: Iterable[str], folder: Path) -> Iterator[tuple[str, Any]]:
    """Run the commands in ``folder``; yields (file name, reduced document)."""
    for name in names:
        result = heli3dof(*words(name, folder))
        yield f"{name}.json", {"exit_code": result.code, "document": reduced(result.document)}
        if name in RECORDED:
            yield f"{name}.recording.json", recorded(folder / f"{name}.mcap")

"""Renders docs/results/benchmarks.md and its CSV tables from benchmarks.json.

The page shows the figures of `ROWS`. ``data/figures.csv`` has every figure, ``data/TOPIC-N.csv``
each table. Command: ``python -m tests.bench.page``.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from tests.pages.page import Page
from tests.paths import ROOT

FOLDER = ROOT / "docs" / "results"
STORE = FOLDER / "benchmarks.json"
PAGE = FOLDER / "benchmarks.md"
DATA = FOLDER / "data"

ROWS: tuple[tuple[str, str, str], ...] = (
    ("hidden", "right cause first, rich plan, medium and large",
     "diagnosis: one hidden effect of medium or large size reported first, plan `rich`"),
    ("hidden", "both of two hidden causes", "diagnosis: both of two hidden causes found"),
    ("hidden", "false alarms where nothing is hidden, rich",
     "diagnosis: false alarms, plan `rich`"),
    ("hidden", "false alarms where nothing is hidden, steps",
     "diagnosis: false alarms, plan `steps`"),
    ("hidden", "outside the catalogue: flagged with the right axis",
     "diagnosis: unknown torque reported on the right axis"),
    ("hidden", "names asserted without a tie that are wrong, over everything",
     "diagnosis: wrong names, of all causes without confounded effects"),
    ("hidden", "95 % intervals that hold the truth",
     "diagnosis: coverage of the causes' 95 % intervals"),
    ("hidden", "**heli3dof diagnose**, 60 s at 500 Hz, 2 cores: slowest",
     "diagnosis: longest time for 60 s of flight at 500 Hz"),
    ("rigs", "right cause first, or confounded with the first",
     "diagnosis, other rigs: right cause first, or confounded with the first"),
    ("rigs", "nothing hidden: nothing asserted",
     "diagnosis, other rigs: no hidden effect; no wrong name or residual torque reported"),
    ("rigs", "flights with a wrong name asserted",
     "diagnosis, other rigs: flights with a wrong name"),
    ("rigs", "outside the catalogue: true formula proposed",
     "diagnosis, other rigs: true formula proposed for an unknown torque"),
    ("rigs", "outside the catalogue: gain of the extended model over that of the true term, mean",
     "diagnosis, other rigs: unknown torque, decrease of the prediction error over that by the "
     "true formula"),
    ("rigs", "confidence of named causes: largest deviation from the share of right ones",
     "diagnosis, other rigs: largest difference of stated confidence and share of right causes"),
    ("third", "rich: right cause first, or confounded with the first",
     "diagnosis, third plant: right cause first, or confounded with the first, plan `rich`"),
    ("third", "steps: right cause first, or confounded with the first",
     "diagnosis, third plant: right cause first, or confounded with the first, plan `steps`"),
    ("third", "run-step: right cause first, or confounded with the first",
     "diagnosis, third plant: right cause first, or confounded with the first, one step"),
    ("third", "nothing hidden: nothing asserted",
     "diagnosis, third plant: no hidden effect; no wrong name or residual torque reported"),
    ("third", "flights with a wrong name asserted",
     "diagnosis, third plant: flights with a wrong name"),
    ("third", "both of two hidden causes",
     "diagnosis, third plant: both of two hidden causes found"),
    ("third", "outside the catalogue: right axis",
     "diagnosis, third plant: unknown torque reported on the right axis"),
    ("rules", "rules with which an answer is better",
     "diagnosis: [rules](data/rules-1.csv) that improve more answers than they worsen"),
    ("greybox", "RMS of parameter error / CRB, multisine",
     "grey box: RMS parameter error over the Cramér–Rao bound"),
    ("greybox", "coverage of the 95 % intervals, multisine",
     "grey box: coverage of the 95 % intervals"),
    ("greybox", "10° step: coverage of 95 % intervals, without bias correction",
     "grey box, 10° step: coverage of the 95 % intervals of T_g and inertias, bias not corrected"),
    ("greybox", "10° step: coverage of 95 % intervals, with bias correction",
     "grey box, 10° step: coverage of the same intervals, bias corrected as by `identify`"),
    ("greybox", "time to fit 90 s at 500 Hz", "grey box: time to fit 90 s of flight"),
    ("peers", "median parameter error, output error's over the grey box's",
     "output error (AeroID): median parameter error, divided by the grey box's"),
    ("real", "rig-a: grey box, over 3 s, in flight (`usable_runs`)",
     "real rig-a: RMS error of predictions up to 3 s ahead, held-out, roll / pitch / yaw"),
    ("real", "rig-b: grey box, over 3 s, in flight (`usable_runs`)",
     "real rig-b: RMS error of predictions up to 3 s ahead, held-out, roll / pitch / yaw"),
    ("loop", "500 Hz, without privileges: late by more than 1 ms",
     "loop at 500 Hz, no privileges: periods late by more than 1 ms, or missed"),
    ("loop", "500 Hz, with real-time scheduling: late by more than 1 ms",
     "loop at 500 Hz, real-time scheduling, serial line: periods late by more than 1 ms, or "
     "missed"),
    ("loop", "500 Hz, with real-time scheduling, over TCP: late by more than 1 ms",
     "loop at 500 Hz, real-time scheduling, TCP: periods late by more than 1 ms, or missed"),
    ("kill", "kill -9: last command to zero volts, worst",
     "`kill -9`: longest time from the last command to zero volts"),
    ("kill", "kill -9: data lost, worst", "`kill -9`: most data lost"),
    ("estop", "stopped by the flying session, longest",
     "`estop` from another terminal, longest time to the confirmed stop"),
    ("estop", "stopped directly, session hangs, longest",
     "`estop` of a flight whose process hangs, longest time to the confirmed stop"),
    ("watches", "the emulated rig: flights with a frozen encoder that end as completed",
     "frozen encoder, emulated rig: flights that end as completed"),
    ("watches", "the firmware: flights with a frozen encoder that end as completed",
     "frozen encoder, firmware without noise: flights that end as completed"),
    ("watches", "false trips in 5 h, rich flights", "false trips in 5 h of rich flight"),
    ("safety", "motors not at zero at the end",
     "faults at random moments: flights that end with motors not at zero volts"),
    ("safety", "zero volts later than stated",
     "faults at random moments: flights with zero volts later than "
     "[stated](../reference/safety.md)"),
    ("misbehaviour", "motors not at zero",
     "misbehaving devices: flights that end with motors not at zero volts"),
    ("batch", "`batch identify`: overhead per recording",
     "`batch identify`: overhead per recording"),
    ("batch", "two Dask workers against one: diagnoses per hour",
     "two Dask workers against one: diagnoses per hour"),
    ("batch", "one diagnosis on a cluster: CPU time that remains here",
     "one diagnosis on a cluster: share of CPU time that remains on the local computer"),
    ("soak", "soak: growth of memory, upper limit of the 95 % interval",
     "30 min flight: growth of memory, upper limit of the 95 % interval"),
)  # fmt: skip
"""The lines of the page: (topic, name of its figure in benchmarks.json, label on the page)"""

HEAD = """# Benchmarks

Each row is one measured number. *Bar* is the required value, fixed before the measurement; **no**
marks a row that misses its bar. The last two columns are the command that repeats the measurement,
and the commit that was measured. The computer was shared, so times are upper bounds.

In rows of the diagnosis:

- A simulated rig has hidden effects, which the diagnosis should report as causes.
- *Wrong name*: a reported cause that the rig does not have. Two kinds of causes do not count: those
  reported as confounded with another effect, and those marked "…-like" (unconfirmed).
- *Unknown torque*: a hidden effect that the catalogue lacks.
- *Other rigs*: rigs on which the diagnosis was not developed.
- *Third plant*: a simulator written independently of heli3dof and of the emulated rig.

`python -m tests.bench.page` writes this page from [benchmarks.json](benchmarks.json).
[data/figures.csv](data/figures.csv) contains all measured numbers, including those without a row on
this page. The same folder contains each table of a benchmark as a CSV file.

| what | measured | interval, or how | bar | met | command | commit |
|---|---|---|---|---|---|---|
"""

ERRORS = re.compile(r"closed-|grey box, |extension found")
"""Figures of topic `real` that are prediction errors of a whole model"""

Store = Mapping[str, Mapping[str, Any]]


def load() -> dict[str, dict[str, Any]]:
    """Returns the stored measurements by topic."""
    return json.loads(STORE.read_text(encoding="utf-8")) if STORE.exists() else {}


def command(topic: str, kept: Mapping[str, Any]) -> str:
    return str(kept.get("command", f"make bench TOPIC={topic}"))


def render(store: Store) -> str:
    """Returns the page: a line for each of `ROWS` that was measured without uncommitted changes."""
    shown = [t for t in store if not store[t]["revision"].endswith("-dirty")]
    return HEAD + "".join(_line(store, *row) for row in ROWS if row[0] in shown)


def _line(store: Store, topic: str, what: str, label: str) -> str:
    kept = store[topic]
    figure = next(f for f in kept["figures"] if f["what"] == what)
    met = {True: "yes", False: "**no**", None: "–"}[figure["met"]]
    cells = [label, figure["value"], _interval(figure["how"]), figure["bar"] or "–", met,
             f"`{command(topic, kept)}`", kept["revision"]]  # fmt: skip
    return "| " + " | ".join(str(c).replace("|", "\\|") for c in cells) + " |\n"


def _interval(how: str) -> str:
    """Returns the 95 % interval in a figure's ``how`` if there is one, else its first clause."""
    if match := re.search(r"95 % interval ([\d.]+ to [\d.]+ %)", how):
        return match.group(1)
    return how.split("; ")[0] or "–"


def files(store: Store) -> dict[str, str]:
    """Returns the content of the CSV files by name."""
    rows = [
        [topic, f["what"], f["value"], f["bar"], f["met"], f["how"], command(topic, k),
         k["revision"], k["machine"]]
        for topic, k in store.items() for f in k["figures"]
    ]  # fmt: skip
    head = ["topic", "what", "value", "bar", "met", "how", "command", "commit", "machine"]
    made = {"figures.csv": _csv([head, *rows])}
    for topic, kept in store.items():
        for n, table in enumerate(kept.get("tables", []), 1):
            made[f"{topic}-{n}.csv"] = _csv([table["head"], *table["rows"]])
    return made


def errors_table(rig: str) -> str:
    """Returns a table of the errors of a rig's models, with required values if there are any."""
    rows = ["| model, and where | roll / pitch / yaw | bar |", "|---|---|---|"]
    for f in load()["real"]["figures"]:
        what = f["what"].removeprefix(rig).lstrip(",: ")
        if not f["what"].startswith(rig) or not ERRORS.match(what):
            continue
        label = (
            what.replace(" (`usable_runs`)", "").replace("over 3 s, ", "").replace(", over 3 s", "")
        )
        rows.append(f"| {label} | {f['value']} | {f['bar'] or '–'} |")
        if still := re.search(r"angles held still there (.*)", f["how"]):
            rows.append(f"| angles held still, {label.split(', ', 1)[1]} | {still.group(1)} | – |")
    return "\n".join(rows)


def replays_table(rig: str) -> str:
    """Returns a table of the closed-loop replay errors of a rig's models."""
    rows = ["| flight and model | roll / pitch / yaw |", "|---|---|"]
    for f in load()["replay"]["figures"]:
        flight, found, _ = f["what"].partition(", closed-loop replay")
        if found and flight.startswith(rig):
            rows.append(f"| {flight.removeprefix(rig + ', ')} | {f['value']} |")
    return "\n".join(rows)


CAUSES = "Causes, strongest first"
GAIN = "Gain of the extended model: RMSE of 1 s predictions"
CALIBRATION = "Calibration of the base simulation"
NOT_QUOTED = ("Kept in the model", "Not identifiable", "encoder.scale", "Next", "For the")
"""Beginnings of sentences of `diagnose` that the case studies do not quote"""


def diagnosis_section(rig: str, title: str) -> str:
    """Returns the part of the stored output of `diagnose` below ``title``, up to the next title.

    Sentences below `CALIBRATION` are not part of it: they are those of `diagnosis_sentences`.
    """
    text = _diagnosis(rig).split(f"**{title}**\n")[1].split("\n**")[0]
    return text.partition("\n\n- ")[0].strip() if title == CALIBRATION else text.strip()


def diagnosis_sentences(rig: str) -> str:
    """Returns what the stored output of `diagnose` explains, and what it does not, as a list."""
    text = _diagnosis(rig).split(f"**{CALIBRATION}**\n")[1]
    sentences = (line for line in text.splitlines() if line.startswith("- "))
    return "\n".join(s for s in sentences if not s[2:].startswith(NOT_QUOTED))


def _diagnosis(rig: str) -> str:
    return (DATA / f"{rig}-diagnosis.txt").read_text(encoding="utf-8")


def _csv(rows: list[list[Any]]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def pages(store: Store) -> dict[Path, str]:
    """Returns the content of every file that is rendered from the stored measurements."""
    return {PAGE: render(store)} | {DATA / name: text for name, text in files(store).items()}


def write(store: Store) -> None:
    """Write the page, the CSV files and the tables of the case studies."""
    DATA.mkdir(exist_ok=True)
    for path, text in pages(store).items():
        path.write_text(text, encoding="utf-8")
    for study in STUDIES:
        study.rewrite()


def _study(rig: str) -> dict[str, Callable[[], str]]:
    return {
        "errors": partial(errors_table, rig),
        "causes": partial(diagnosis_section, rig, CAUSES),
        "gain": partial(diagnosis_section, rig, GAIN),
        "calibration": partial(diagnosis_section, rig, CALIBRATION),
        "sentences": partial(diagnosis_sentences, rig),
    }


STUDIES = [
    Page("docs/results/rig-a.md", {**_study("rig-a"), "replays": partial(replays_table, "rig-a")}),
    Page("docs/results/rig-b.md", _study("rig-b")),
]
"""The case studies: figures of topic `real`, and the output of `diagnose` that it stores"""

if __name__ == "__main__":
    write(load())

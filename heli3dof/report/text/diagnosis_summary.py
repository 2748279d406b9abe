"""Summarise a diagnosis in about ten lines: what `heli3dof diagnose` prints without --verbose.

After the verdict and faults, the lines state how wrong the simulation is, and the causes with their
confidence. Then follow the RMSE without and with the causes, errors that no effect explains, and
what to do next.
"""

from __future__ import annotations

from collections.abc import Iterator

from heli3dof.axes import AXES
from heli3dof.diagnosis import name_of
from heli3dof.report.text import diagnosis_sentences as words
from heli3dof.report.text.diagnosis_sentences import Document, listed, percent
from heli3dof.report.text.number_format import fixed

MOST_CAUSES = 4
"""Largest number of causes that the summary states; --verbose lists all"""


def diagnosis_summary(document: Document) -> list[str]:
    """Return the lines of the summary; ``document`` is the JSON document of ``diagnose --json``."""
    weaker = len(_once_each(document)) - MOST_CAUSES
    return [
        words.verdict(document),
        *faults(document),
        *simulation_error(document),
        *words.unconverged(document),
        *words.calibration_change(document),
        *causes(document),
        *([f"{weaker} weaker cause{'s' * (weaker > 1)}: see --verbose."] if weaker > 0 else []),
        *words.gain(document),
        *words.unmodelled_effects(document),
        *words.slow_noise(document),
        *list(words.next_steps(document))[:1],
    ]


def diagnosis_text(document: Document) -> str:
    """Return the summary of a diagnosis as one text; ``document`` is its JSON document."""
    return "\n".join(diagnosis_summary(document))


def faults(document: Document) -> list[str]:
    """Return sentences on faults: those that end the diagnosis or ended the flight, timing effects.

    The list contains no sentence twice. If several recordings have the same timing effect, one
    sentence describes the effect in the first of these recordings, and names the other recordings.
    With --verbose, heli3dof prints a sentence for each fault.
    """
    by_check = dict[str, list[Document]]()
    for f in document.get("integrity", ()):
        if f["kind"] in ("bad_data", "not_identifiable") or f.get("check") == "flight.tripped":
            by_check[f["sentence"]] = [f]
        elif f["kind"] == "finding":
            by_check.setdefault(name_of(f), []).append(f)
    out = []
    for first, *others in by_check.values():
        (sentence,) = words.faults({"integrity": [first]})
        names = [str(f["recording"]) for f in others]
        out.append(sentence + (f". The same in {listed(names, 'and')}" if names else ""))
    return out


def simulation_error(document: Document) -> Iterator[str]:
    """Yield one line with RMSE and noise floor by axis, or nothing if no error was measured."""
    error = document["simulation_error"]
    known = [axis for axis in AXES if error[axis]["rmse_deg"] is not None]
    parts = []
    for axis in known:
        floor, rmse = error[axis]["noise_floor_deg"], error[axis]["rmse_deg"]
        size = f" {fixed(floor, 2, '°')}" if floor is not None and rmse > floor else ""
        least = words.number(document["gain"]["holdout_rmse_deg"]["after"].get(axis))
        if floor is not None and floor > words.NOISE_EXCESS * least:
            # The extended model refutes this floor: its error contains all of the noise.
            size = f" at most {fixed(least, 2, '°')}"
        noise = "" if floor is None else f" (noise{size})"
        parts.append(f"{axis} {fixed(rmse, 2, '°')}{noise}")
    if parts:
        seconds = error[known[0]]["horizon_s"]
        yield f"Simulation error, RMSE of {seconds:g} s predictions: {', '.join(parts)}."


def causes(document: Document) -> Iterator[str]:
    """Yield a line for each of the first `MOST_CAUSES` causes, with its size and confidence."""
    for n, f in enumerate(_once_each(document)[:MOST_CAUSES], start=1):
        sizes = []
        for key, estimate in f["parameters"].items():
            parameter, unit = words.quantity_and_unit(f, key)
            value, std = words.size_and_std(key, estimate)
            size = f"{value} ± {std}" if std else value
            sizes.append(f"{parameter.replace('_', ' ')} {size}{' ' * bool(unit)}{unit}")
        what_and_size = ", ".join([name_of(f), *sizes])
        untested = words.untested(document, f)
        known = f["confidence"] is not None and not untested
        others = [str(x) for x in f["tied_with"]]
        confounded = f"; or {listed(others, 'or')}, indistinguishable here" if others else ""
        what = "one of them acts: " if others else ""
        sure = f" ({what}confidence {percent(f['confidence'])})" if known else ""
        like = "; likely, not confirmed" if f.get("like") else ""
        like = "; not tested (--quick)" if untested else like
        if words.is_allowed_for(f):  # last (`heli3dof.diagnosis.result.in_order`)
            how = "counted" if words.is_counted(f) else "known from the time stamps"
            yield f"In the recording: {what_and_size} ({how})."
            continue
        yield f"Cause {n}: {what_and_size}{confounded}{sure}{like}."


def _once_each(document: Document) -> list[Document]:
    """Return one cause per effect: jitter found in several recordings is one cause."""
    return list({name_of(f): f for f in reversed(document["findings"])}.values())[::-1]

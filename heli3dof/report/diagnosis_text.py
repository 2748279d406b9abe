"""A diagnosis in sentences, from the contract's document alone: verdict, faults, causes, what next.

Each sentence stands by itself; those of `faults` and `next_steps` end with something to do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from heli3dof.diagnosis.counts import flyable
from heli3dof.errors import UsageError
from heli3dof.model.effects import term
from heli3dof.report.text_table import NONE, fixed

Document = Mapping[str, Any]

VERDICTS = {
    "explained": "What the simulation gets wrong is explained by the causes below.",
    "nothing_found": "Nothing was found that noise alone would not explain.",
    "ambiguous": "Something is wrong, but this recording cannot tell its possible causes apart.",
    "unexplained": "Something is left that no known cause explains.",
    "not_identifiable": "These recordings hold too little to say what is wrong.",
    "bad_data": "The recording itself is at fault: no physics is blamed before that is mended.",
}
UNCONFIRMED = "Something would fit better, but is not confirmed by data that it has not seen."
LISTED = 6
"""Names in a sentence before the rest are counted."""
MUCH = 1.5
"""How much larger than the simulation's error a noise floor is no floor any more."""
COUNTED = "encoder.scale."
NEVER = frozenset({"encoder.offset.yaw"})
"""What no flight can show: nothing but a cable knows yaw's zero. Not worth a sentence."""


def name_of(finding: Document) -> str:
    """``friction.coulomb`` on ``yaw`` → ``friction.coulomb.yaw``."""
    axis = finding.get("axis")
    return str(finding["effect"]) if axis is None else f"{finding['effect']}.{axis}"


def variable(name: str) -> str:
    """A variable as people write it.

    >>> variable("pitch*roll_rate")
    'pitch × roll rate'
    """
    return name.replace("_", " ").replace("*", " × ")


def listed(names: Sequence[str], word: str = "and") -> str:
    """Names in a sentence.

    >>> listed(["a", "b", "c"]), listed(["a"], "or")
    ('a, b and c', 'a')
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"


def summary_of(name: str) -> str:
    """What a cause is, in the catalogue's words; empty where this catalogue does not know it."""
    try:
        return term(name).effect.summary
    except UsageError:
        return ""


def verdict(document: Document) -> str:
    """The one sentence to take away."""
    word = str(document["verdict"])
    said = f"Verdict: {word.replace('_', ' ')}. {VERDICTS[word]}"
    if word != "nothing_found":
        return said
    if document.get("dropped"):
        said = f"Verdict: nothing found. {UNCONFIRMED}"
    doubtful = [str(c["parameter"]) for c in not_surely(document)]
    if doubtful:
        said += f" But {listed(doubtful)} may be off: see the calibration."
    return said


def not_surely(document: Document) -> list[Document]:
    """The base's numbers that are estimated beyond the profile's tolerance, and not surely."""
    return [c for c in document["calibration"] if c.get("beyond_tolerance") == "not_surely"]


def perhaps_off(document: Document) -> Iterator[str]:
    """What is far from the profile's and no finding, why it is none, and what would tell."""
    doubtful = not_surely(document)
    for c in doubtful:
        off = number(c["value"]) / c["nominal"] - 1
        spread = fixed(100 * number(c["std"]) / abs(c["nominal"]), 1, " %")
        yield (
            f"{c['parameter']} is estimated {fixed(100 * abs(off), 1, ' %')} "
            f"{'above' if off > 0 else 'below'} the profile's (± {spread}); that is not surely "
            f"beyond the {100 * c['tolerance']:g} % to which it is believed, so it is no finding."
        )
    if doubtful:
        yield (
            f"To settle {listed([str(c['parameter']) for c in doubtful])}: weigh and measure the "
            "rig (docs/reference/profile.md); or diagnose a larger flight together with these "
            "(heli3dof run large)."
        )


def faults(document: Document) -> Iterator[str]:
    """What the integrity checks say: what happened, the likely cause, what to do."""
    for f in document.get("integrity", ()):
        if not isinstance(f, Mapping):
            yield str(f)
            continue
        what = str(f["sentence"])
        cause = f" Likely cause: {f['cause']}" if f.get("cause") else ""
        fix = f" Try: {f['fix']}" if f.get("fix") else ""
        yield f"{'Note: ' if f['kind'] == 'note' else ''}{what}{cause}{fix}"


def unmeasured(document: Document) -> Iterator[str]:
    """What was not fitted; where how wrong the simulation is has no number, or none beside it."""
    beside = document.get("about", {}).get("not_fitted")
    if beside:
        yield (
            f"Not fitted, for they did not read all three angles, but held beside the model: "
            f"{', '.join(beside)}."
        )
    fitted = document["verdict"] not in ("bad_data", "not_identifiable")
    error = document["simulation_error"]
    if fitted and error and all(e["rmse_deg"] is None for e in error.values()):
        seconds = next(iter(error.values()))["horizon_s"]
        yield (
            f"How wrong the simulation is was not measured: no stretch without a gap or a stop is "
            f"long enough to predict {seconds:g} s ahead."
        )
    noisy = [
        axis
        for axis, e in error.items()
        if number(e["noise_floor_deg"]) > MUCH * number(e["rmse_deg"])
    ]
    if noisy:
        yield (
            f"On {listed(noisy)} the fitted model expects more noise than the simulation is wrong: "
            "some of what it calls noise is none (dry friction or play does that), and sizes on "
            "that axis are rough."
        )


def causes(document: Document) -> Iterator[str]:
    """Each finding: what it is, how sure that is, and what it cannot be told from."""
    for f in document["findings"]:
        name = name_of(f)
        what = summary_of(name)
        said = f"{name}: {what}" if what else f"{name}."
        sure = f["confidence"]
        if f["tied_with"]:
            said += f" Something is there ({certainty(sure)}), but it cannot be told from "
            said += _others(name, [str(x) for x in f["tied_with"]])
        elif sure is not None:
            said += f" Certainty that it is there: {certainty(sure)}."
        named = f["gain"]["holdout_log_likelihood"] is not None
        if named and f["axis"] in {rest["axis"] for rest in document["leftover"]}:
            said += (
                f" As something without a name acts on {f['axis']} too, read it as {name}-like: "
                "it may stand in for a part of that."
            )
        elif f.get("like"):
            said += (
                " Its size is open, it may be what is wrong with another one's formula, or data "
                f"that it has not seen do not surely confirm it: read it as {name}-like, something "
                "acts as this would."
            )
        yield said


def _others(name: str, tied: Sequence[str]) -> str:
    """What a finding is tied with, and what would tell them apart where no flight does."""
    counted = [n for n in tied if n.startswith(COUNTED)]
    flown = flyable(name, tied)
    weighed = [n for n in tied if n not in flown and n not in counted]
    said = []
    if flown:
        said.append(f"{listed(flown, 'or')} by these recordings: any of them fits about as well.")
    if counted:
        said.append(
            f"{'Nor from ' if flown else ''}{listed(counted, 'or')} by any flight: "
            f"{turned(counted)}."
        )
    if weighed:
        said.append(
            f"{'Nor from ' if said else ''}motor.thrust_gain by any flight: thrust and weight "
            "scale together; a scale under the arm, or masses that are known, decide."
        )
    return " ".join(said)


def turned(counted: Sequence[str]) -> str:
    """What tells a wrong count per revolution.

    >>> turned(["encoder.scale.yaw"])[:45]
    'turn yaw by hand through an angle that you kn'
    """
    axes = listed([n.removeprefix(COUNTED) for n in counted], "and")
    return (
        f"turn {axes} by hand through an angle that you know, and see with `heli3dof monitor` "
        "whether the encoder counts as much"
    )


def adopted(document: Document) -> bool:
    """Whether the model was extended; a fault of the recording or a calibration extends nothing."""
    return any(
        f["gain"]["holdout_log_likelihood"] is not None or "measured_on" in f["gain"]
        for f in document["findings"]
    )


def leftovers(document: Document) -> Iterator[str]:
    """What has no name, on which axis it acts and on what it depends."""
    for rest in document["leftover"]:
        share = number(rest["share"])
        said = (
            f"Left over: a torque on {rest['axis']} that depends on {variable(rest['depends_on'])}"
        )
        if math.isfinite(share):
            said += f", {share * 100:.0f} % of what is unexplained"
        if rest.get("also"):
            also = listed([variable(str(v)) for v in rest["also"]], "or")
            said += f" (or on {also}: this flight hardly tells)"
        if rest.get("like"):
            said += f"; it is {rest['like']}, not surely that cause"
        yield f"{said}."


def unadopted(document: Document) -> Iterator[str]:
    """Causes that were found and do not pay, and what could not be seen at all."""
    for x in document.get("dropped", ()):
        span = x["gain"].get("holdout_log_likelihood_interval", (None, None))
        if span is None:  # judged by free flights
            yield f"Not adopted: {x['effect']} is not needed on blocks that the fit has not seen."
            continue
        low, high = span
        why = str(x.get("why", "it does not surely pay on data that it has not seen"))
        if high is not None and high < 0:
            why = "data that it has not seen contradict it" + (
                ": is the hold-out from the same rig?" if document["holdout"] else ""
            )
        told = f"ln L {fixed(number(low), 0)} … {fixed(number(high), 0)}"
        yield f"Not adopted: {x['effect']} fits these recordings better, but {why} ({told})."
    dark = [str(x) for x in document["not_identifiable"] if x not in NEVER]
    counted = [x for x in dark if x.startswith(COUNTED)]
    dark = [x for x in dark if x not in counted]
    if dark:
        more = f" and {len(dark) - LISTED} more" if len(dark) > LISTED else ""
        yield (
            f"These recordings could not show even a large {', '.join(dark[:LISTED])}{more}: "
            "of that nothing is said."
        )
    if counted:
        yield (
            f"Within the profile's tolerance {listed(counted, 'or')} may be there, and no flight "
            f"like these would say so: {turned(counted)}."
        )


def written(document: Document) -> Iterator[str]:
    """How the recordings ask the body's equations to be written, where not in full; no cause."""
    yield from map(str, document.get("about", {}).get("written", ()))


def kept_within(document: Document) -> Iterator[str]:
    """Terms of the extended model that are not named: within what is known of such rigs."""
    for x in document.get("about", {}).get("kept_within_what_is_known", ()):
        each = ", ".join(
            f"{fixed(q['value'], 3)} ± {fixed(q['std'], 3)} {q['unit']} (known beforehand: "
            f"{fixed(q['prior_mean'], 3)} ± {fixed(q['prior_std'], 3)})"
            for q in x["parameters"].values()
        )
        yield f"Kept in the model, but not named a cause: {x['term']}, {each}; {x['why']}."


def still_hidden(document: Document) -> Iterator[str]:
    """What the extended model does not explain, beside what is left over."""
    for x in document.get("about", {}).get("still_hidden", ()):
        yield f"Still hidden: {x['sentence']}"


def next_steps(document: Document) -> Iterator[str]:
    """What to do now, each with its command."""
    if document["verdict"] == "bad_data":
        yield "Mend that, record again or correct the log, and diagnose once more."
        return
    nulls = str(document.get("about", {}).get("nulls", "simulated"))
    if not nulls.startswith("simulated"):
        yield (
            "The loop of these recordings is unknown, so no flights could be simulated to compare "
            "with, and only what is plain is named. Where the controller is known, add "
            "[controller] to the profile."
        )
    upcoming = document["next_experiment"]
    if upcoming is not None:
        yield f"Fly next: heli3dof run {upcoming['plan']}. Why: {upcoming['why']}."
    elif why := document.get("about", {}).get("no_next_experiment"):
        yield f"No plan is recommended: {why}."
    elif document["verdict"] == "nothing_found":
        yield (
            "What is small shows in a larger flight: heli3dof run large, and diagnose it together "
            "with these."
        )
    if document["model"] and any(
        c.get("beyond_tolerance", "no") != "no" for c in document["calibration"]
    ):
        yield (
            "To correct the profile: heli3dof profile update --from "
            f"{document['model']} --profile rig.toml -o rig2.toml writes one with the calibrated "
            "numbers."
        )
    if document["leftover"]:
        yield (
            "For what is left over: look at its picture (--report FILE.html), think what on the "
            "rig could do that, and add it as an effect (CONTRIBUTING.md)."
        )
    if not document["model"] or not adopted(document):
        return
    if not document["holdout"]:
        yield (
            "The gain was measured on blocks left out of the fit. On a flight of its own: "
            "heli3dof diagnose REC... --holdout ANOTHER-REC"
        )
    yield f"Fly the extended simulation: heli3dof simulate steps --model {document['model']}"


def certainty(confidence: float | None) -> str:
    """Never 100 %: nothing is.

    >>> certainty(0.9999), certainty(0.873), certainty(None)
    ('> 99 %', '87 %', '–')
    """
    if confidence is None or not math.isfinite(confidence):
        return NONE
    return "> 99 %" if confidence > 0.99 else f"{confidence * 100:.0f} %"


def number(value: float | None) -> float:
    """NaN for what the document has no number of."""
    return math.nan if value is None else float(value)

"""Write the sentences of a diagnosis from the JSON document of ``diagnose --json``.

The argument ``document`` of a function is the whole JSON document; docs/reference/contract.md
defines its keys. `faults` and `next_steps` also state what the user can do.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from heli3dof.axes import AXES
from heli3dof.diagnosis import name_of
from heli3dof.diagnosis.conclusion.confounded_parameters import separable_by_flight
from heli3dof.diagnosis.conclusion.wrong_lengths import is_far
from heli3dof.diagnosis.constants import SIGMAS_95
from heli3dof.diagnosis.unmodelled.unmodelled_torque import LIKE_SUFFIX
from heli3dof.diagnosis.validation.gain import removes_most
from heli3dof.errors import UsageError, minus, quoted
from heli3dof.identification.greybox.thrust_scale import Measured
from heli3dof.identification.profile_update import ratio_unit
from heli3dof.model.effects import effects, term
from heli3dof.model.parameter_units import split_unit
from heli3dof.recording.provenance import run_command
from heli3dof.report.text.number_format import NONE, fixed, significant

Document = Mapping[str, Any]

VERDICTS = {
    "explained": "The causes below explain the simulation error.",
    "nothing_found": "No simulation error beyond noise was found.",
    "off_calibration": "Only the profile's numbers are wrong: refitted, they explain the error.",
    "ambiguous": "The simulation is wrong, but {}.",
    "unexplained": "Part of the simulation error has no known cause.",
    "not_identifiable": "These recordings carry too little information to name a cause.",
    "bad_data": "The recording itself is faulty: correct it before looking for physical causes.",
}
LIKELY = "The remaining error is probably {}, which these recordings do not confirm."
NOT_IMPORTED = "The log cannot be imported as it is."
ONLY_ALLOWED_FOR = "Only {} were found; the fit allows for them."
BY_REFIT = "Refitted parameters explain the simulation error; see the causes below."
WITH_REFIT = (
    "Refitted parameters explain one part of the simulation error, the causes below the rest."
)
NOISE_UNKNOWN = "No effect was found; how much of the simulation error is noise is unknown here."
ERROR_IS_LARGER = "No effect explains the simulation error, which exceeds the noise on {}."
NOISE_IS_LARGER = "No effect was found, but the fitted noise may hide one on {}."
WRONG_PROFILE = "A wrong length or mass in the profile is likely: correct it before searching on."
UNCONFIRMED = "A further effect ({}) would fit better, but {}."
LISTED = 6
"""Largest number of names that a sentence lists; of further names it gives only the number."""
NOISE_EXCESS = 1.5
"""Ratio of noise floor to simulation error, above which `limits` and `verdict` warn (chosen)."""
COUNTED = "lost_share"
"""The only parameter that is counted, not estimated, and so has no standard deviation"""
STAMPS = "uneven time stamps"
SCALE_PREFIX = "encoder.scale."
YAW_ZERO = "encoder.offset.yaw"
"""An effect that no flight shows: only a cable's torque depends on yaw's zero"""


def variable(name: str) -> str:
    """Return in words the variable whose key in the document is ``name``.

    >>> variable("pitch*roll_rate")
    'pitch × roll rate'
    """
    return name.replace("_", " ").replace("*", " × ")


def listed(names: Sequence[str], word: str = "and") -> str:
    """Return names joined for a sentence, with ``word`` before the last.

    >>> listed(["a", "b", "c"]), listed(["a"], "or")
    ('a, b and c', 'a')
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"


def summary_of(name: str) -> str:
    """Return the description of the effect called ``name``; empty for an unknown effect."""
    try:
        return term(name).effect.summary
    except UsageError:
        return ""


def verdict(document: Document) -> str:
    """Return a diagnosis' verdict and what it means, in one to three sentences."""
    word = str(document["verdict"])
    meaning = VERDICTS[word]
    if word == "explained" and refit_explains(document):
        meaning = WITH_REFIT if adopted(document) else BY_REFIT
    if word == "ambiguous":
        meaning = meaning.format(_why_ambiguous(document))
    if likely := likely_effects(document):
        meaning = LIKELY.format(f"the effect{'s' * (len(likely) > 1)} {listed(likely)}")
    if word == "unexplained" and far_inertias(document):
        meaning = WRONG_PROFILE
    if _only_import_failed(document):
        meaning = NOT_IMPORTED
    found = document["findings"]
    if word == "explained" and found and all(map(is_allowed_for, found)):
        what = {"lost samples" if is_counted(f) else STAMPS for f in found}
        meaning = ONLY_ALLOWED_FOR.format(listed(sorted(what)))
    if word == "nothing_found":
        if noise_is_unknown(document):
            meaning = NOISE_UNKNOWN
        elif noisy := noisy_axes(document):
            meaning = NOISE_IS_LARGER.format(listed(noisy))
        elif unexplained := axes_beyond_noise(document):
            meaning = ERROR_IS_LARGER.format(listed(unexplained))
        if dropped := document.get("dropped", ()):
            reasons = dict.fromkeys(reason_against(document, x) for x in dropped)
            names = listed([str(x["effect"]) for x in dropped], "or")
            meaning = UNCONFIRMED.format(names, "; ".join(reasons))
        doubtful = [str(c["parameter"]) for c in not_significantly_off(document)]
        if doubtful:
            meaning += f" But {listed(doubtful)} may be off: see the calibration."
    return f"Verdict: {word.replace('_', ' ')}. {meaning}"


def likely_effects(document: Document) -> list[str]:
    """Return the effects of the catalogue that the residual torques resemble.

    The result is empty unless each residual torque resembles an effect, and no other error remains
    unexplained.
    """
    names = [str(x.get("like") or "") for x in document["leftover"]]
    return list(dict.fromkeys(n.removesuffix(LIKE_SUFFIX) for n in names)) if all(names) else []


def _why_ambiguous(document: Document) -> str:
    """Return which causes the recordings do not separate, or which one they do not confirm."""
    doubtful = (f for f in document["findings"] if f["tied_with"] or f.get("like"))
    first = next(doubtful, None)
    if first is None:
        return "these recordings do not separate the possible causes"
    if not first["tied_with"]:
        return f"these recordings do not confirm {name_of(first)}"
    names = [name_of(first), *map(str, first["tied_with"])]
    if len(names) > LISTED:
        names = [*names[: LISTED - 1], f"{len(names) - LISTED + 1} other causes"]
    return f"these recordings do not separate {listed(names)}"


def _only_import_failed(document: Document) -> bool:
    """Return True if the verdict is ``bad_data`` only because heli3dof could not import a log."""
    bad = [f["check"] for f in document.get("integrity", ()) if f["kind"] == "bad_data"]
    return bool(bad) and set(bad) == {"log.refused"}


def noise_is_unknown(document: Document) -> bool:
    """Return True if the simulation error was measured, but the noise floor is unknown."""
    known = [e for e in document["simulation_error"].values() if e["rmse_deg"] is not None]
    return bool(known) and all(e["noise_floor_deg"] is None for e in known)


def noisy_axes(document: Document) -> list[str]:
    """Return the axes whose noise floor is over `NOISE_EXCESS` times the simulation error."""
    return [
        axis
        for axis, e in document["simulation_error"].items()
        if number(e["noise_floor_deg"]) > NOISE_EXCESS * number(e["rmse_deg"])
    ]


def axes_beyond_noise(document: Document) -> list[str]:
    """Return the axes on which noise causes less than half of the mean square simulation error."""
    return [
        axis
        for axis, e in document["simulation_error"].items()
        if number(e["rmse_deg"]) ** 2 > 2 * number(e["noise_floor_deg"]) ** 2
    ]


def rmse_before_and_after(*gains: Document) -> str:
    """Return as text how successive changes of the model change the held-out RMSE of each axis.

    ``gains``: for each change, its JSON object ``gain`` with the RMSE (°) before and after it.

    >>> rmse = {"before": {"roll": 2.31, "pitch": 1.2}, "after": {"roll": 0.4, "pitch": 1.1}}
    >>> rmse_before_and_after({"holdout_rmse_deg": rmse})
    'roll 2.31° → 0.40°, pitch 1.20° → 1.10°'
    """
    stages = [gains[0]["holdout_rmse_deg"]["before"]]
    stages += [gain["holdout_rmse_deg"]["after"] for gain in gains]
    return ", ".join(
        f"{axis} {' → '.join(fixed(rmse[axis], 2, '°') for rmse in stages)}"
        for axis in AXES
        if stages[0].get(axis) is not None
    )


def refit_explains(document: Document) -> bool:
    """Return True if refitting the profile's parameters explains the error of at least one axis.

    The refit must remove most of the mean square error of this axis, and the decrease must be
    significant (`heli3dof.diagnosis.validation.gain.removes_most`). If the verdict is
    ``off_calibration``, the function returns True without a test, because this verdict already
    states that the refit explains the error.

    The refitted model contains no causes. So if the diagnosis added causes to the model, a changed
    parameter may only compensate for a cause. In this case, two more conditions must hold:

    - A second fit estimates the parameters together with the causes. At least one ratio of two
      parameters, such as K_f/J_roll, then differs from its value in the profile (`changed_ratios`).
    - In the model with the causes, the refit also removes most of the error of at least one axis.
      The JSON key ``explains_with_causes`` states this. If the value is null (not measured), the
      condition counts as met.
    """
    if document["verdict"] == "off_calibration":
        return True
    gain = document.get("calibration_gain", {})
    if adopted(document):
        only_compensates = gain.get("explains_with_causes") is False
        if only_compensates or not changed_ratios(document):
            return False
    error = gain.get("holdout_rmse_deg")
    return any(
        won is not None
        and removes_most(
            number(error["before"][axis]), number(error["after"][axis]), won["interval"][0]
        )
        for axis, won in gain.get("rmse_reduction_deg", {}).items()
    )


def changed_ratios(document: Document) -> list[Document]:
    """Return the ratios of parameters, such as K_f/J_roll, that differ from the profile.

    The difference must be larger than two standard deviations of the estimated ratio.
    """
    ratios = document.get("ratios", ())
    return [r for r in ratios if abs(r["value"] - r["nominal"]) > 2 * r["std"]]


def states_refit(document: Document) -> bool:
    """Return True if the sentences state by how much refitted parameters reduce the RMSE."""
    unknown = document["verdict"] == "nothing_found" and noise_is_unknown(document)
    return unknown or refit_explains(document)


def calibration_change(document: Document) -> Iterator[str]:
    """Yield up to two sentences on ratios of parameters that differ from the profile.

    The first sentence lists these ratios (`changed_ratios`) if the RMSE of the refit is stated
    (`states_refit`). The second sentence states the factor by which all ratios K_f/J differ from
    the profile, if they have one in common (`common_factor`).
    """
    off = [
        f"{r['ratio']} = {significant(r['value'], r['std'])} ± {significant(r['std'], r['std'])} "
        f"{ratio_unit(r['ratio'])} (profile: {significant(r['nominal'], r['std'])})"
        for r in changed_ratios(document)
    ]
    if off and states_refit(document):
        fit = ", fitted together with the causes" if adopted(document) else ""
        yield f"Not as in the profile{fit}: {', '.join(off)}."
    if factor := common_factor(document):
        yield (
            f"All ratios K_f/J differ from the profile by one factor, {factor:.2f}. Either the "
            f"thrust gain K_f is wrong, or the log's times are multiplied by {factor**-0.5:.2f}."
        )


def common_factor(document: Document) -> float | None:
    """Return the factor by which the ratios K_f/J of all three axes differ from the profile.

    Each axis has its own estimated factor; the result is their median. It is None if an axis has no
    estimate, if the factors are not equal within the profile's tolerance, or if the median differs
    from 1 by less than the tolerance.
    """
    factors = [
        r["value"] / r["nominal"] for r in document.get("ratios", ()) if "K_f/J" in r["ratio"]
    ]
    if len(factors) != len(AXES) or min(factors) <= 0:
        return None
    margin = 1 + max(c["tolerance"] for c in document["calibration"])
    middle = statistics.median(factors)
    is_common = max(factors) < margin * middle and min(factors) > middle / margin
    return middle if is_common and not 1 / margin < middle < margin else None


def gain(document: Document) -> Iterator[str]:
    """Yield a sentence that compares the RMSE of up to three models, axis by axis.

    These are the profile's model, the refitted model, and the model with the causes. The profile's
    model is left out if `states_refit` is False. If the only change of the model is one unmodelled
    torque, `unmodelled_effects` states the RMSE, and this function yields nothing.
    """
    refit = states_refit(document)
    causes = has_adopted_causes(document)
    torques = sum(bool(rest.get("term")) for rest in document["leftover"])
    changes, stages = [], ["refitted"]
    if refit:
        changes, stages = [document["calibration_gain"]], ["profile", *stages]
    if causes or torques > 1 - refit:
        added = ["these causes"] * causes + ["the unmodelled torque"] * bool(torques)
        changes, stages = [*changes, document["gain"]], [*stages, f"with {' and '.join(added)}"]
    if changes:
        falls = rmse_before_and_after(*changes)
        yield f"RMSE on {measured_on(document)}, {' → '.join(stages)}: {falls}."


def not_significantly_off(document: Document) -> list[Document]:
    """Return the calibration's entries that are outside the tolerance, but not significantly."""
    return [c for c in document["calibration"] if c.get("beyond_tolerance") == "not_surely"]


def calibration_doubts(document: Document) -> Iterator[str]:
    """Yield sentences on parameters that may be outside the tolerance, and on how to check them."""
    doubtful = not_significantly_off(document)
    for c in doubtful:
        off = number(c["value"]) / c["nominal"] - 1
        std = number(c["std"]) / abs(c["nominal"])
        tolerance = f"the tolerance of {100 * c['tolerance']:g} %"
        reason = f"is not significantly beyond {tolerance}, so it is no finding"
        if abs(off) - c["tolerance"] > SIGMAS_95 * std:
            reason = (
                f"exceeds {tolerance}. It is no finding: held-out data do not confirm it, or an "
                "unmodelled effect may cause it"
            )
        yield (
            f"{c['parameter']} is estimated {fixed(100 * abs(off), 1, ' %')} "
            f"{'above' if off > 0 else 'below'} the profile's value (± "
            f"{fixed(100 * std, 1, ' %')}). This {reason}."
        )
    if doubtful:
        yield (
            f"To settle {listed([str(c['parameter']) for c in doubtful])}: weigh and measure the "
            "rig (docs/reference/profile.md), or diagnose these recordings together with a larger "
            f"flight ({_fly(document, 'large')})."
        )


def faults(document: Document) -> Iterator[str]:
    """Yield a sentence per fault of the recordings, with its likely cause and remedy."""
    for f in document.get("integrity", ()):
        if not isinstance(f, Mapping):
            yield str(f)
            continue
        note = "Note: " if f["kind"] == "note" else ""
        note += "Recording " if f["sentence"].startswith(f"{f['recording']}: ") else ""
        cause = f" Likely cause: {minus(f['cause'])}" if f.get("cause") else ""
        fix = f" Try: {f['fix']}" if f.get("fix") else ""
        yield f"{note}{minus(f['sentence'])}{cause}{fix}"


def limits(document: Document) -> Iterator[str]:
    """Yield sentences on what limits the diagnosis: recordings, null simulations and noise."""
    not_fitted = document.get("about", {}).get("not_fitted")
    if not_fitted:
        yield (
            "Not fitted, because an angle is missing; used to check the fitted model: "
            f"{', '.join(not_fitted)}."
        )
    fitted = document["verdict"] not in ("bad_data", "not_identifiable")
    error = document["simulation_error"]
    if fitted and error and all(e["rmse_deg"] is None for e in error.values()):
        seconds = next(iter(error.values()))["horizon_s"]
        yield (
            f"The simulation error was not measured: no stretch without a gap or a stop is long "
            f"enough to predict {seconds:g} s ahead."
        )
    nulls = str(document.get("about", {}).get("nulls", "simulated"))
    if not nulls.startswith("simulated"):
        yield (
            f"There are no null simulations ({nulls.rpartition(': ')[2]}), so only clear causes "
            "are reported. If you know the controller, add [controller] to the profile."
        )
    yield from unconverged(document)
    noisy = noisy_axes(document)
    if noisy:
        yield (
            f"On {listed(noisy)} the fitted noise is larger than the simulation error. Part of it "
            "is not noise (dry friction and backlash look like this), so sizes on that axis are "
            "rough."
        )


def unconverged(document: Document) -> Iterator[str]:
    """Yield a sentence if the search for the extended model's parameters had not converged."""
    if document.get("about", {}).get("converged") is False:
        yield (
            "The fit of the extended model had not converged, so its parameters, its noise and the "
            "noise floor may be wrong. Likely cause: motion that no effect explains, or too little "
            "motion. Diagnose the recordings together with another flight: heli3dof diagnose REC "
            "REC..."
        )


def causes(document: Document) -> Iterator[str]:
    """Yield a paragraph per cause: description, confidence, and effects confounded with it."""
    unmodelled = {rest["axis"] for rest in document["leftover"] if rest["depends_on"]}
    for f in document["findings"]:
        name = name_of(f)
        what = summary_of(name)
        text = f"{name}: {what}" if what else f"{name}."
        confidence = f["confidence"]
        if f["tied_with"]:
            sure = f"confidence {percent(confidence)}"
            sure = "not tested: --quick" if untested(document, f) else sure
            text += f" An effect is present ({sure}), confounded with "
            text += _confounded(name, [str(x) for x in f["tied_with"]])
        elif untested(document, f):
            text += " Not tested on left-out blocks: --quick."
        elif confidence is not None:
            text += f" Confidence: {percent(confidence)}."
        if f["gain"]["holdout_log_likelihood"] is not None and f["axis"] in unmodelled:
            text += (
                f" An unmodelled effect also acts on {f['axis']} and may account for part of "
                f"this: read it as {name}-like."
            )
        elif f.get("like") and not untested(document, f):
            text += (
                f" Read it as {name}-like: its size is uncertain, it may compensate for another "
                "cause's model error, or held-out data do not confirm it."
            )
        yield text


def is_counted(finding: Document) -> bool:
    """Return True if the size of a finding was counted, not estimated.

    Only the share of lost samples is counted.
    """
    return set(finding["parameters"]) == {COUNTED}


def is_allowed_for(finding: Document) -> bool:
    """Return True if the simulation of the recording includes the fault ``finding``.

    Such a fault causes no simulation error. The simulation includes lost samples, because the
    recording shows which samples are missing. It includes sampling jitter if the time stamps are
    exact (`heli3dof.integrity.Fault.allowed_for`).
    """
    return is_counted(finding) or bool(finding.get("allowed_for"))


def quantity_and_unit(finding: Document, key: str) -> tuple[str, str]:
    """Return quantity and unit of a cause's parameter ``key``; the unit may be empty.

    The unit is the end of the name, or else that of the installed effect's parameter.

    >>> quantity_and_unit({"effect": "friction.coulomb"}, "torque_Nm")
    ('torque', 'N·m')
    """
    quantity, unit = split_unit(key)
    effect = effects().get(finding["effect"])
    stated = {q.name: q.unit for q in effect.parameters} if effect else {}
    return quantity, unit or stated.get(key, "").replace("–", "")


def size_and_std(key: str, estimate: Document) -> tuple[str, str]:
    """Return the size of a cause's parameter ``key``, and its standard deviation, as two texts.

    The second text is "" for the share of lost samples, which is counted, not estimated.

    >>> size_and_std("torque_Nm", {"value": 0.03012, "std": 0.00042})
    ('0.03012', '0.00042')
    >>> size_and_std("lost_share", {"value": 0.03977, "std": 0.017})
    ('0.03977', '')
    """
    value, std = estimate["value"], estimate["std"]
    if key == COUNTED:
        return significant(value), ""
    return significant(value, std), significant(std, std)


def untested(document: Document, finding: Document) -> bool:
    """Return True if a finding is unconfirmed only because quick mode left the test out."""
    return bool(finding.get("like") and document.get("about", {}).get("causes_untested"))


def _confounded(name: str, others: Sequence[str]) -> str:
    """Return a text that names the effects confounded with ``name`` and how to separate them."""
    scales = [n for n in others if n.startswith(SCALE_PREFIX)]
    flights = separable_by_flight(name, others)
    weights = [n for n in others if n not in flights and n not in scales]
    parts = []
    if flights:
        parts.append(f"{listed(flights, 'or')}: these recordings do not decide between them.")
    if scales:
        parts.append(f"{listed(scales, 'or')} in any flight: {turn_by_hand(scales)}.")
    if weights:
        parts.append(
            f"{listed(weights, 'or')} in any flight: thrust and weight scale together. Put a scale "
            "under the arm, or use known masses."
        )
    return " Also confounded with ".join(parts)


def turn_by_hand(scales: Sequence[str]) -> str:
    """Return an instruction to check the encoders' counts per revolution by hand.

    >>> turn_by_hand(["encoder.scale.yaw"])[:35]
    'turn yaw by hand through a known an'
    """
    axes = listed([n.removeprefix(SCALE_PREFIX) for n in scales])
    return (
        f"turn {axes} by hand through a known angle and compare with the angle that "
        "`heli3dof monitor` shows"
    )


def adopted(document: Document) -> bool:
    """Return True if the diagnosis added at least one cause or unmodelled torque to the model."""
    return has_adopted_causes(document) or any(rest.get("term") for rest in document["leftover"])


def has_adopted_causes(document: Document) -> bool:
    """Return True if the diagnosis added at least one cause of the catalogue to the model."""
    return any(
        f["gain"]["holdout_log_likelihood"] is not None or "measured_on" in f["gain"]
        for f in document["findings"]
    )


def measured_on(document: Document) -> str:
    """Return a text that names the data on which `diagnose` measured the model's RMSE.

    The text is, for example, "the held-out recordings". It applies to the RMSE of the model without
    the causes, and to the RMSE of the model with the causes.
    """
    if document["gain"].get("measured_on") == "the recordings themselves":
        return "the fitted recordings themselves, which is optimistic"
    return "the held-out recordings" if document["holdout"] else "blocks left out of the fit"


def unmodelled_effects(document: Document) -> Iterator[str]:
    """Yield sentences on torques without a known cause, and a last one on unexplained errors."""
    for rest in (x for x in document["leftover"] if x["depends_on"]):
        share = number(rest["share"])
        text = (
            f"Unmodelled effect: a torque on {rest['axis']} that depends on "
            f"{variable(rest['depends_on'])}"
        )
        if math.isfinite(share) and not rest.get("term"):
            text += f", {share * 100:.0f} % of the unexplained variance"
        if rest.get("also"):
            also = listed([variable(str(v)) for v in rest["also"]], "or")
            text += f" (or on {also}: this flight hardly separates them)"
        if rest.get("like"):
            text += f"; it is {rest['like']} (not confirmed)"
        if rest.get("term"):
            yield f"{text}."
            yield _torque_term(rest, measured_on(document))
        else:
            yield f"{text}. The extended model does not contain it."
    if remaining := [x for x in document["leftover"] if x.get("error_deg")]:
        yield _remaining(document, remaining)


def _remaining(document: Document, remaining: Sequence[Document]) -> str:
    """Return a sentence on the errors that the extended model leaves without an explanation."""
    each = []
    for x in remaining:
        e = x["error_deg"]
        noise = e["noise_floor"]
        known = "" if noise is None else f" (noise {fixed(noise, 2, '°')})"
        sizes = fixed(e["extended_model"], 2, "°"), fixed(e["simulation"], 2, "°")
        each.append(f"{x['axis']} {sizes[0]} of {sizes[1]}{known}")
    seconds = document["gain"]["horizon_s"]
    unknown = " How much of it is noise is unknown." if noise_is_unknown(document) else ""
    return (
        f"Not explained: most of the simulation error remains, {', '.join(each)} "
        f"(RMSE of {seconds:g} s predictions on {measured_on(document)}).{unknown} To find its "
        "cause, diagnose several flights of the rig together: heli3dof diagnose REC REC..."
    )


def slow_noise(document: Document) -> Iterator[str]:
    """Yield a sentence on residual torques that depend on no measured variable, if any."""
    each = [f"{x['axis']} ({x['rms_Nm']:.2g} N·m RMS)" for x in document.get("slow_noise", ())]
    if each:
        yield (
            f"Slow torque noise on {listed(each, 'and')}: it depends on nothing that was measured, "
            "so no model predicts it. Draughts or a swinging cable cause such noise."
        )


def _torque_term(rest: Document, where: str) -> str:
    """Return sentences on an unmodelled torque, of which ``rest`` is the JSON object."""
    gain = f"Its contribution on {where}: {rmse_before_and_after(rest['gain'])}."
    if not rest["formula"]:
        return f"The extended model contains it as a curve; no formula fits as well. {gain}"
    c = rest["formula_parameters"]["c"]
    product = variable(rest["formula"].removeprefix("c * ").replace(" * ", "*"))
    size = f"{significant(c['value'], c['std'])} ± {significant(c['std'], c['std'])} {c['unit']}"
    others = [variable(p) for p in rest["formula_alternatives"]]
    instead = f" (as good: {listed(others, 'or')})" if others else ""
    return f"The extended model contains it as c × {product}{instead}, c = {size}. {gain}"


def reason_against(document: Document, dropped: Document) -> str:
    """Return the reason why the diagnosis did not adopt an effect of ``document["dropped"]``."""
    _, high = dropped["gain"].get("holdout_log_likelihood_interval") or (None, None)
    if high is None or high >= 0:
        return str(dropped.get("why", "held-out data do not confirm its gain"))
    other = ": is the hold-out from the same rig?" if document["holdout"] else ""
    return f"held-out data contradict it{other}"


def not_adopted(document: Document) -> Iterator[str]:
    """Yield sentences on effects not added to the model, and on effects not identifiable."""
    for x in document.get("dropped", ()):
        span = x["gain"].get("holdout_log_likelihood_interval", (None, None))
        if span is None:  # compared by multi-step predictions
            yield f"Not adopted: {x['effect']} does not improve predictions of left-out blocks."
            continue
        low, high = span
        reason = reason_against(document, x)
        change = f"ln L {fixed(low, 0)} … {fixed(high, 0)}"
        yield f"Not adopted: {x['effect']} fits these recordings better, but {reason} ({change})."
    hidden = [str(x) for x in document["not_identifiable"]]
    scales = [x for x in hidden if x.startswith(SCALE_PREFIX)]
    no_flight = [x for x in hidden if x == YAW_ZERO]
    hidden = [x for x in hidden if x not in scales + no_flight]
    if hidden:
        more = f" and {len(hidden) - LISTED} more" if len(hidden) > LISTED else ""
        yield (
            f"Not identifiable from these recordings, even if large: {', '.join(hidden[:LISTED])}"
            f"{more}."
        )
    if scales:
        yield (
            f"{listed(scales, 'or')} within the profile's tolerance is not identifiable from such "
            f"flights: {turn_by_hand(scales)}."
        )
    if no_flight:
        yield f"{YAW_ZERO} is not identifiable from any flight: no motion depends on yaw's zero."


def equation_changes(document: Document) -> Iterator[str]:
    """Yield a sentence on each simplified equation of motion in the extended model."""
    yield from map(str, document.get("about", {}).get("written", ()))


def kept_terms(document: Document) -> Iterator[str]:
    """Yield a sentence per effect that is in the extended model, but is not reported as a cause."""
    for x in document.get("about", {}).get("kept_within_what_is_known", ()):
        sizes = ", ".join(
            f"{fixed(q['value'], 3)} ± {fixed(q['std'], 3)} {q['unit']} (prior: "
            f"{fixed(q['prior_mean'], 3)} ± {fixed(q['prior_std'], 3)})"
            for q in x["parameters"].values()
        )
        yield f"Kept in the model, not reported as a cause: {x['term']}, {sizes}; {x['why']}."


def model_deviations(document: Document) -> Iterator[str]:
    """Yield a sentence per take-off or slow roll drift that the extended model does not explain."""
    for x in document.get("about", {}).get("still_hidden", ()):
        yield f"Not explained: {x['sentence']}"


def far_inertias(document: Document) -> list[Document]:
    """Return the estimated inertias that suggest a wrong length or mass in the profile.

    The result is a list of entries of ``calibration``, a key of the diagnosis' JSON document. Each
    of these inertias differs from the profile's value significantly, and by more than the factor
    `conclusion.wrong_lengths.FAR`.

    The recordings may not distinguish a wrong inertia from another effect, such as a wrong encoder
    scale. Such an inertia is in the list only if the diagnosis has found corrected lengths. With
    these lengths, the profile's inertias agree with all estimates.
    """
    is_explained = "corrected_lengths_m" in document.get("about", {})
    confounded = {name_of(f) for f in document["findings"] if f["tied_with"]}
    return [
        c
        for c in document["calibration"]
        if c["parameter"].startswith("J_")
        and c.get("beyond_tolerance") == "surely"
        and is_far(Measured(c["nominal"], number(c["value"]), number(c["std"])))
        and (is_explained or c["parameter"].replace("J_", "inertia.") not in confounded)
    ]


def wrong_masses_or_lengths(document: Document) -> list[str]:
    """Return a sentence on a probable mistake in the profile's lengths or masses, if any."""
    far = far_inertias(document)
    if not far:
        return []
    factors = [(c["parameter"], number(c["value"]) / c["nominal"]) for c in far]
    each = [f"{name} is {factor:.2f} times nominal" for name, factor in factors]
    text = f"{listed(each)}. Likely cause: a wrong length or mass in the profile"
    if any(rest["depends_on"] for rest in document["leftover"]):
        text += ", which an unmodelled torque may only compensate for"
    lengths = document.get("about", {}).get("corrected_lengths_m", {})
    right = [f"{n} = {x['value']:.4g} m (profile: {x['profile']:.4g})" for n, x in lengths.items()]
    if right:
        half = ", half the distance between the motors' shafts" * ("L_h" in lengths)
        text += f". With {listed(right)}{half}, all inertias agree with the profile"
    keys = [f"geometry.{n}" for n in lengths] or ["[geometry] and [mass]"]
    return [f"{text}. Measure and correct {listed(keys)}, then run heli3dof diagnose again."]


def _profile_update(document: Document) -> Iterator[str]:
    """Yield a sentence with the command that writes a calibrated profile, if it is worthwhile."""
    off = refit_explains(document) or any(
        c.get("beyond_tolerance") == "surely" for c in document["calibration"]
    )
    if document["model"] and off:
        yield (
            "To write a profile with the calibrated values: heli3dof profile update --from "
            f"{quoted(document['model'])} -o rig2.toml"
        )


def _fly(document: Document, plan: str) -> str:
    """Return the command that flies a ``plan`` on the rig of the diagnosed recordings."""
    about = document.get("about", {})
    return run_command(plan, about.get("device"), about.get("profile"))


def next_steps(document: Document) -> Iterator[str]:
    """Yield sentences on what the user can do next, with a command where there is one."""
    if document["verdict"] == "bad_data":
        yield (
            "Correct this as stated above, then run heli3dof diagnose again."
            if _only_import_failed(document)
            else "Correct the log or record again, then run heli3dof diagnose again."
        )
        return
    wrong_profile = wrong_masses_or_lengths(document)
    yield from wrong_profile
    if document["verdict"] == "off_calibration":
        yield from _profile_update(document)
    upcoming, likely = document["next_experiment"], likely_effects(document)
    if upcoming is not None:
        yield f"Next experiment: {_fly(document, upcoming['plan'])}. Reason: {upcoming['why']}."
    elif reason := document.get("about", {}).get("no_next_experiment"):
        yield f"No next experiment is recommended: {reason}."
    elif document["verdict"] == "nothing_found":
        why = "A larger flight shows smaller effects"
        if axes_beyond_noise(document):
            why = "A larger flight may show the cause"
        yield (
            f"{why}: {_fly(document, 'large')}, then diagnose it together with these recordings."
        )
    elif likely:
        yield (
            f"To confirm {listed(likely)}: {_fly(document, 'large')}, then diagnose it together "
            "with these recordings."
        )
    has_formula = any(rest.get("formula") for rest in document["leftover"])
    if likely and not wrong_profile:
        yield (
            f"To fit {listed(likely)} without confirming it: heli3dof identify REC... --terms "
            f"{','.join(f'+{name}' for name in likely)}"
        )
    elif has_formula and document["model"] and not wrong_profile:
        yield (
            "To turn the formula of the unmodelled torque into an effect: heli3dof effect new "
            f"--from {quoted(document['model'])}"
        )
    if document["verdict"] != "off_calibration":
        yield from _profile_update(document)
    has_curve = any(rest["depends_on"] and not rest.get("formula") for rest in document["leftover"])
    if has_curve and not (likely or wrong_profile):
        yield (
            "For the unmodelled effect: study its figure (--report FILE.html), find what on the "
            "rig could cause it, and add it as an effect (CONTRIBUTING.md)."
        )
    if not document["model"] or not adopted(document):
        return
    model = quoted(document["model"])
    yield f"To simulate the extended model: heli3dof simulate steps --model {model}"
    if not document["holdout"]:
        yield (
            f"The gain was measured on {measured_on(document)}. To measure it on another "
            "flight: heli3dof diagnose REC... --holdout ANOTHER-REC"
        )


def percent(confidence: float | None) -> str:
    """Format a confidence (0 to 1) in percent; above 99 % as ``> 99 %``, None as a dash.

    >>> percent(0.9999), percent(0.873), percent(None)
    ('> 99 %', '87 %', '–')
    """
    if confidence is None or not math.isfinite(confidence):
        return NONE
    return "> 99 %" if confidence > 0.99 else f"{confidence * 100:.0f} %"


def number(value: float | None) -> float:
    """Return a number of the JSON document as a float; None (undefined) becomes NaN."""
    return math.nan if value is None else float(value)

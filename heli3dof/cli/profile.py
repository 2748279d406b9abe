"""``heli3dof profile new|show|check|update``: writes, shows, checks or corrects a profile."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli.options import Force, OutputFile, ProfileFile, rig_profile
from heli3dof.cli.output import Output, add_family, verb
from heli3dof.errors import ProfileError, UnstableLoop, UsageError, minus

if TYPE_CHECKING:
    from heli3dof.model.control.loop_check import LoopCheck
    from heli3dof.rig.profile import Profile

SOURCE = "the command line"
"""Where a new profile's numbers come from, for error messages"""

File = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="A profile; default: the paper's rig."),
]


def register(app: typer.Typer) -> None:
    verbs = {"new": new, "show": show, "check": check, "update": update}
    help = "Write, show, check or correct a rig's profile."
    add_family(app, "profile", verbs, help=help, heading="Plans and rigs")


@verb
def new(
    out: Output,
    words: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="E.g. geometry.L_a=0.66. Repeatable."),
    ] = None,
    start: Annotated[
        Path | None, typer.Option("--from", metavar="FILE", help="Start from this profile.")
    ] = None,
    no_controller: Annotated[
        bool,
        typer.Option(
            "--no-controller",
            help="Write no [controller]: the controller of the rig's logs is unknown.",
        ),
    ] = False,
    output: OutputFile = None,
    force: Force = False,
) -> None:
    """Write a commented profile: heli3dof profile new -o rig.toml.

    The command asks for the required values that neither --set nor --from gives.
    """
    from heli3dof.cli.profile_questions import COMPUTED, ask_missing, check_keys
    from heli3dof.recording.atomic_write import check_outputs, write_file
    from heli3dof.rig.profile import load_profile, profile_from_dict
    from heli3dof.rig.profile_file import HOVER_REMARK, merged, new_text, settings
    from heli3dof.toml_file import read_toml, value_at

    path = output or Path("rig.toml")
    check_outputs(path, force=force)
    given = settings(words or ())
    check_keys(given)
    data = given
    remarks: dict[str, str] = {}
    if start is not None:
        old = load_profile(start)  # raises ProfileError if it is invalid
        data = merged(read_toml(start, "profile", ProfileError), given)
        if value_at(given, COMPUTED) is None and HOVER_REMARK in start.read_text("utf-8-sig"):
            remarks[COMPUTED] = HOVER_REMARK
            if old.motor.V_o == _rounded_hover_voltage(old):  # else measured, or other masses
                data["motor"].pop("V_o")
    ask_missing(out, data)
    if value_at(data, COMPUTED) is None:
        _compute_hover_voltage(data, remarks)
    if no_controller:
        if "controller" in given:
            raise UsageError(
                "--no-controller contradicts --set controller.…",
                cause="a profile without [controller] means that the controller is unknown.",
                fix="one of the two",
            )
        data.pop("controller", None)
    elif value_at(given, "controller.K") is None:
        _design_gain(data, remarks)
    profile = profile_from_dict(data, source=SOURCE)
    loop = _check_loop(out, profile)
    if not loop.stable and profile.controller_is_known:
        from heli3dof.model.control.stability import check_hover_loop

        check_hover_loop(profile)  # raises, with the poles and the cause
    write_file(path, new_text(data, remarks).encode(), force=force)
    if COMPUTED in remarks:
        out.warn(
            f"motor.V_o = {profile.motor.V_o:g} V per motor was computed: its size from the "
            "masses, its sign from the rest angle. The size is a small difference of large "
            "torques: measure it before the first flight (docs/reference/profile.md)"
        )
    if not no_controller:
        is_designed = "controller.K" in remarks
        out.note(
            f"Gain: {'designed for this rig by LQR' if is_designed else 'as given, or default'}"
        )
    _report(out, path, profile, loop, with_loop=not no_controller)
    out.note(f"Profile: {path}")


@verb
def show(out: Output, file: File = None) -> None:
    """Show a profile's numbers with units, then derived quantities and stability margins."""
    from rich.table import Table

    from heli3dof.toml_file import key_of, keys, value_at

    profile = rig_profile(file)
    table = Table("key", "value", "unit", "meaning")
    table.columns[0].no_wrap = True
    head = ""
    for name, field in keys(type(profile)):
        key, value = key_of(field), value_at(profile, name)
        if value is None or key is None:
            continue
        section, _, last = name.rpartition(".")
        if section and section != head:
            table.add_row(f"[{section}]")
        head = section
        table.add_row(last, _shown(value), key.unit, key.meaning)
    table.add_section()
    for name, (number, unit, meaning) in _derived(profile).items():
        table.add_row(name, minus(f"{number:.4g}"), unit, meaning)
    out.show(table)
    _report(out, file, profile, _check_loop(out, profile))


@verb
def check(out: Output, file: File = None) -> None:
    """Check a profile: keys, plausible numbers, and the stability of its loop."""
    profile = rig_profile(file)
    loop = _check_loop(out, profile)
    if not _report(out, file, profile, loop):
        out.show("Nothing unusual.")
    _exit_if_unstable(profile, loop)


@verb
def update(
    out: Output,
    source: Annotated[
        Path,
        typer.Option("--from", metavar="FILE", help="A model file, or a diagnose --json file."),
    ],
    profile: ProfileFile = None,
    output: OutputFile = None,
    force: Force = False,
) -> None:
    """Write a profile with measured numbers: profile update --from MODEL --profile rig.toml."""
    from rich.table import Table

    from heli3dof.identification.profile_update import (
        applied,
        changes,
        check_same_rig,
        read_calibration,
    )
    from heli3dof.recording.atomic_write import check_outputs, default_output, write_file
    from heli3dof.rig.profile import default_profile, load_profile, profile_from_dict
    from heli3dof.rig.profile_file import changed_text, new_text

    stem = "rig" if profile is None else profile.stem
    path = output or default_output(Path(f"{stem}-calibrated.toml"), force=force)
    check_outputs(path, force=force)
    measured = read_calibration(source)
    if profile is not None:
        rig, text = load_profile(profile), profile.read_text(encoding="utf-8-sig")
    else:
        rig = measured.profile or default_profile()
        text = new_text(rig.to_dict())
    check_same_rig(measured, rig, str(profile or "the default profile"))
    made = changes(measured, rig)
    calibrated = profile_from_dict(applied(rig, made), source=f"the profile updated from {source}")
    write_file(path, changed_text(text, made).encode(), force=force)
    table = Table("key", "before", "now", "source")
    for c in made:
        table.add_row(c.key, _shown(c.before), _shown(c.value), c.comment)
    out.show(table)
    if measured.left_out:
        out.note(
            f"No key of a profile holds: {', '.join(measured.left_out)}. They are in the model "
            "file: simulate with --model."
        )
    loop = _check_loop(out, calibrated)
    _report(
        out, path, calibrated, loop,
        changes=[{"key": c.key, "before": c.before, "value": c.value} for c in made],
        left_out=list(measured.left_out),
    )  # fmt: skip
    out.note(f"Profile: {path}")
    _exit_if_unstable(calibrated, loop)


def _compute_hover_voltage(data: dict[str, Any], remarks: dict[str, str]) -> None:
    """Estimate the hover voltage from the masses; store it in ``data``, a comment in ``remarks``.

    ``data``: the profile as nested dicts; ``remarks``: dotted key → comment.
    """
    from heli3dof.rig.profile import profile_from_dict
    from heli3dof.rig.profile_file import HOVER_REMARK, put

    put(data, "motor.V_o", 0.0)  # valid for any amplifier, so that all other keys are checked
    rough = profile_from_dict(data, source=SOURCE)
    put(data, "motor.V_o", _rounded_hover_voltage(rough))
    remarks["motor.V_o"] = HOVER_REMARK


def _rounded_hover_voltage(profile: Profile) -> float:
    """Return the estimated hover voltage (V) with the digits that ``profile new`` writes."""
    from heli3dof.rig.profile_remarks import estimated_hover_voltage

    return float(f"{estimated_hover_voltage(profile):.4g}")


def _design_gain(data: dict[str, Any], remarks: dict[str, str]) -> None:
    """Design an LQR controller's gain; store it in the profile ``data``, a comment in ``remarks``.

    If the designed gain equals the default gain, the key ``controller.K`` is removed instead.
    """
    from heli3dof.model.control.lqr import is_default_gain, lqr_gain
    from heli3dof.rig.profile import profile_from_dict
    from heli3dof.rig.profile_file import put

    gain = lqr_gain(profile_from_dict(data, source=SOURCE))
    data.setdefault("controller", {})
    if is_default_gain(gain):
        data["controller"].pop("K", None)
        return
    put(data, "controller.K", gain)
    remarks["controller.K"] = (
        "Designed by heli3dof profile new: LQR of the hover model with two integrals, "
        "Q = diag(100, 1, 10, 0, 0, 2, 10, 0.1), R = 0.05 (24/v_max)²"
    )


def _check_loop(out: Output, profile: Profile) -> LoopCheck:
    from heli3dof.model.control.loop_check import check_loop_of

    with out.working("Checking the loop on the rigid body …"):
        return check_loop_of(profile)


def _exit_if_unstable(profile: Profile, loop: LoopCheck) -> None:
    """Exit with UnstableLoop's code if the controller in ``profile`` does not stabilise the rig."""
    if not loop.stable and profile.controller_is_known:
        raise typer.Exit(UnstableLoop.exit_code)


def _report(
    out: Output,
    file: Path | None,
    profile: Profile,
    loop: LoopCheck,
    *,
    with_loop: bool = True,
    **more: Any,
) -> list[str]:
    """Print stability margins, warnings and the JSON document; return the warnings.

    If ``with_loop`` is False, only the JSON document describes the loop. ``more``: further entries
    of this document.
    """
    from heli3dof.rig.profile_remarks import unusual_values

    remarks = [*unusual_values(profile), *(loop.unusual() if with_loop else ())]
    out.show(*map(minus, _loop_lines(loop) if with_loop else ()))
    out.warn(*map(minus, remarks))
    if not loop.stable and with_loop:
        gain = "default gain" if profile.controller is None else "gain"
        remarks.append(
            f"the {gain} does not stabilise this rig; heli3dof profile new --from FILE designs "
            "another"
        )
        if profile.controller_is_known:
            out.fail(f"Error: {remarks[-1]}.")
        else:
            out.warn(remarks[-1])
    out.emit(
        {
            "schema": "heli3dof.profile/1",
            "file": None if file is None else str(file),
            "profile": profile.to_dict(),
            "derived": {n: {"value": v, "unit": u} for n, (v, u, _) in _derived(profile).items()},
            "unusual": remarks,
            "loop": _loop_document(loop),
            **more,
        }
    )
    return remarks


def _derived(profile: Profile) -> dict[str, tuple[float, str, str]]:
    """Return quantities computed from the profile: name → (value, unit, meaning)."""
    from heli3dof.axes import AXES
    from heli3dof.rig.profile_remarks import mass_hover_voltage

    derived = {
        "T_g": (profile.trim_torque, "N·m", "torque of gravity on the level arm, 2 L_a K_f V_o"),
        "V_o of the masses": (
            mass_hover_voltage(profile),
            "V",
            "hover voltage of the masses",
        ),
    }
    for axis, J in zip(AXES, profile.inertias, strict=True):
        derived[f"J_{axis}"] = (J, "kg·m²", "inertia of the level rig, as every model uses it")
    limit = profile.motor.K_f * profile.motor.v_max
    derived["thrust limit"] = (limit, "N", "of one motor at v_max")
    return derived


def _shown(value: Any) -> str:
    if isinstance(value, tuple):
        return minus("\n".join(" ".join(f"{x:g}" for x in row) for row in value))
    return minus(f"{value:.5g}" if isinstance(value, float) else str(value))


def _loop_lines(loop: LoopCheck) -> Iterator[str]:
    pole = loop.poles[0]
    yield f"Loop: {'stable' if loop.stable else 'UNSTABLE'}, rightmost pole {pole.real:+.3f} rad/s"
    if loop.disk_margin is not None:
        yield (
            f"Margins, both motors at once: gain × or ÷ {loop.gain_margin:.2f}, phase "
            f"{loop.phase_margin_deg:.0f}° (disk margin {loop.disk_margin:.2f})"
        )
    for s in loop.steps:
        yield (
            f"Simulated {s.name.removeprefix('a ')}: {s.axis} peaks at {s.peak_deg:.1f}°, at most "
            f"{s.highest_V:.1f} V"
            + (f", {s.saturated_s:.2f} s at the limit" if s.saturated_s else "")
        )


def _loop_document(loop: LoopCheck) -> dict[str, Any]:
    return {
        "stable": loop.stable,
        "rightmost_pole_rad_per_s": float(loop.poles[0].real),
        "disc_margin": loop.disk_margin,
        "gain_margin": loop.gain_margin,
        "phase_margin_deg": loop.phase_margin_deg,
        "steps": [
            {
                "name": s.name.removeprefix("a "),
                "axis": s.axis,
                "target_deg": s.target_deg,
                "peak_deg": s.peak_deg,
                "overshoot_deg": s.overshoot_deg,
                "highest_V": s.highest_V,
                "saturated_s": s.saturated_s,
                "safety_trip": s.trip,
            }
            for s in loop.steps
        ],
    }

"""``profile new|show|check|update``: a rig's numbers asked for, shown, checked, corrected."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli.options import AsJson, Force, Output, ProfileFile, Quiet
from heli3dof.cli.output import Talk, verb

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

    from heli3dof.model.control.loop_check import LoopCheck
    from heli3dof.rig.profile import Profile

UNSTABLE = 6
"""Exit code of a gain that does not stabilise the rig; its document is printed all the same."""
SIGNS = {True: "stable", False: "UNSTABLE"}

File = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="A profile; default: the paper's rig."),
]


def register(app: typer.Typer) -> None:
    family = typer.Typer(no_args_is_help=True)
    family.command("new")(new)
    family.command("show")(show)
    family.command("check")(check)
    family.command("update")(update)
    about = "A rig's numbers: write, show, check or correct a profile."
    app.add_typer(family, name="profile", help=about)


@verb
def new(
    given: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="geometry.L_a=0.66 … Repeatable."),
    ] = None,
    start: Annotated[
        Path | None, typer.Option("--from", metavar="FILE", help="Start from this profile.")
    ] = None,
    output: Output = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented profile: heli3dof profile new -o rig.toml asks for the numbers."""
    from heli3dof.errors import ProfileError
    from heli3dof.recording.atomic_write import check_output, write_file
    from heli3dof.rig.profile import load_profile, profile_from_dict
    from heli3dof.rig.profile_file import merged, new_text, put, settings
    from heli3dof.rig.profile_remarks import estimated_hover_voltage
    from heli3dof.toml_file import read_toml

    talk = Talk(as_json=as_json, quiet=quiet)
    path = output or Path("rig.toml")
    check_output(path, force=force)
    data: dict[str, Any] = {}
    if start is not None:
        load_profile(start)  # says what is wrong in it
        data = read_toml(start, "profile", ProfileError)
    data = merged(data, settings(given or ()))
    _complete(talk, data)
    remarks: dict[str, str] = {}
    computed = "V_o" not in data.get("motor", {})
    if computed:
        # Checked with a voltage that any amplifier gives; then the masses' own.
        put(data, "motor.V_o", 0.0)
        rough = profile_from_dict(data, source="the command line")
        put(data, "motor.V_o", float(f"{estimated_hover_voltage(rough):.4g}"))
        remarks["motor.V_o"] = (
            "COMPUTED from the masses, with the sign that the rest angle asks for: measure it"
        )
    profile = profile_from_dict(data, source="the command line")
    designed = _design(data, profile, settings(given or ()), remarks)
    profile = profile_from_dict(data, source="the command line")
    found = _loop(talk, profile)
    if not found.stable:
        from heli3dof.model.control.stability import check_hover_loop

        check_hover_loop(profile)  # raises UnstableLoop
    write_file(path, new_text(data, remarks).encode(), force=force)
    if computed:
        talk.warn(
            f"motor.V_o = {profile.motor.V_o:g} V per motor was computed from the masses. It is "
            "a small difference of large torques: measure it before the first flight "
            "(docs/reference/profile.md)"
        )
    talk.note(
        "Gain: " + ("designed for this rig by LQR" if designed else "as given, or the default")
    )
    _report(talk, path, profile, found)
    talk.note(f"Profile: {path}")


@verb
def show(file: File = None, as_json: AsJson = False, quiet: Quiet = False) -> None:
    """Every number of a profile with its unit, what follows from it, and its loop's margins."""
    from rich.table import Table

    from heli3dof.rig.profile import default_profile, load_profile
    from heli3dof.rig.profile_remarks import value_at
    from heli3dof.toml_file import key_of, keys

    talk = Talk(as_json=as_json, quiet=quiet)
    profile = load_profile(file) if file else default_profile()
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
    for name, (derived, unit, meaning) in _derived(profile).items():
        table.add_row(name, f"{derived:.4g}", unit, meaning)
    talk.show(table)
    _report(talk, file, profile, _loop(talk, profile))


@verb
def check(file: File = None, as_json: AsJson = False, quiet: Quiet = False) -> None:
    """All that is wrong or unusual in a profile at once: keys, numbers, and its loop."""
    from heli3dof.rig.profile import default_profile, load_profile

    talk = Talk(as_json=as_json, quiet=quiet)
    profile = load_profile(file) if file else default_profile()
    found = _loop(talk, profile)
    if not _report(talk, file, profile, found):
        talk.show("Nothing unusual.")
    if not found.stable and profile.loop_is_known:
        raise typer.Exit(UNSTABLE)


@verb
def update(
    source: Annotated[
        Path,
        typer.Option("--from", metavar="FILE", help="A model file, or what diagnose --json wrote."),
    ],
    profile: ProfileFile = None,
    output: Output = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """A new profile with measured numbers: profile update --from MODEL --profile rig.toml."""
    from rich.table import Table

    from heli3dof.diagnosis.profile_update import (
        applied,
        changes,
        check_same_rig,
        read_calibration,
    )
    from heli3dof.recording.atomic_write import check_output, ours, write_file
    from heli3dof.rig.profile import default_profile, load_profile, profile_from_dict
    from heli3dof.rig.profile_file import changed_text, new_text

    talk = Talk(as_json=as_json, quiet=quiet)
    stem = "rig" if profile is None else profile.stem
    path = output or ours(Path(f"{stem}-calibrated.toml"), force=force)
    check_output(path, force=force)
    found = read_calibration(source)
    if profile is not None:
        rig, text = load_profile(profile), profile.read_text(encoding="utf-8")
    else:
        rig = found.profile or default_profile()
        text = new_text(rig.to_dict())
    check_same_rig(found, rig, str(profile or "the default profile"))
    made = changes(found, rig)
    calibrated = profile_from_dict(applied(rig, made), source=f"the profile updated from {source}")
    write_file(path, changed_text(text, made).encode(), force=force)
    table = Table("key", "before", "now", "")
    for c in made:
        table.add_row(c.key, _shown(c.before), _shown(c.value), c.comment)
    talk.show(table)
    if found.left_out:
        talk.note(
            f"No key of a profile holds: {', '.join(found.left_out)}. They stay in the model file: "
            "simulate with --model."
        )
    loop = _loop(talk, calibrated)
    _report(
        talk, path, calibrated, loop,
        changes=[{"key": c.key, "before": c.before, "value": c.value} for c in made],
        left_out=list(found.left_out),
    )  # fmt: skip
    talk.note(f"Profile: {path}")
    if not loop.stable and calibrated.loop_is_known:
        raise typer.Exit(UNSTABLE)


def _complete(talk: Talk, data: dict[str, Any]) -> None:
    """Ask for the required keys that are missing; where nobody can be asked, name them all."""
    from heli3dof.errors import UsageError
    from heli3dof.rig.profile_file import put

    missing = [n for n, field in _asked() if field.is_required() and _at(data, n) is None]
    missing = [n for n in missing if n != "motor.V_o"]
    if not missing:
        return
    if not _is_terminal():
        raise UsageError(
            f"{len(missing)} numbers are missing: {', '.join(missing)}.",
            cause="the input is no terminal, so they cannot be asked for.",
            fix="--set KEY=VALUE for each (heli3dof profile show lists units and a rig's values), "
            "or --from FILE",
        )
    talk.err.print(
        "The rig's numbers, with Enter for the value in brackets. Ctrl-C ends without a file.",
        soft_wrap=True,
    )
    for name, field in _asked():
        if _at(data, name) is None and (value := _answer(talk, name, field)) is not None:
            put(data, name, value)


def _is_terminal() -> bool:
    """Whether somebody can be asked."""
    return sys.stdin.isatty()


def _asked() -> Iterator[tuple[str, FieldInfo]]:
    """The keys that are asked for: the required ones and the arm's rest angle."""
    from heli3dof.rig.profile import Profile
    from heli3dof.toml_file import keys

    for name, field in keys(Profile):
        if name in ("name", "encoder.roll_rest_deg") or field.is_required():
            yield name, field


def _answer(talk: Talk, name: str, field: FieldInfo) -> Any:
    """A number typed in, asked for again until it is plausible; None: leave the key out."""
    from heli3dof.rig.profile_file import toml_value
    from heli3dof.toml_file import key_of, within

    key = key_of(field)
    assert key is not None
    unit = "" if key.unit == "–" else f" in {key.unit}"
    how = f"\n  How: {key.measure}." if key.measure else ""
    talk.err.print(f"\n{name}: {key.meaning}{how}", soft_wrap=True, markup=False)
    default = None if field.is_required() else field.default
    typical = f" (common: {key.typical})" if key.typical else ""
    if name == "motor.V_o":
        default, typical = "", " (Enter: from the masses)"
    while True:
        try:
            text = str(typer.prompt(f"  {name}{unit}{typical}", default=default, err=True)).strip()
        except typer.Abort:
            raise KeyboardInterrupt from None
        if field.annotation is str:
            return text
        if not text and name == "motor.V_o":
            return None
        value = toml_value(text)
        whole = field.annotation is int
        if isinstance(value, bool) or not isinstance(value, int if whole else (int, float)):
            talk.err.print(f"  {text!r} is no {'whole ' if whole else ''}number.", markup=False)
        elif key.plausible is not None and not within(value, key.plausible):
            low, high = key.plausible
            talk.err.print(
                f"  Not plausible: {low:g} to {high:g} {key.unit}. {key.slip(value)}", markup=False
            )
        else:
            return value


def _at(data: Mapping[str, Any], name: str) -> Any:
    at: Any = data
    for part in name.split("."):
        at = at.get(part) if isinstance(at, Mapping) else None
    return at


def _design(
    data: dict[str, Any],
    profile: Profile,
    given: Mapping[str, Any],
    remarks: dict[str, str],
) -> bool:
    """Put an LQR gain into the data, unless one was given or it is the default; whether it did."""
    from heli3dof.model.control.lqr import is_default_gain, lqr_gain
    from heli3dof.rig.profile_file import put

    if _at(given, "controller.K") is not None:
        return False
    data.setdefault("controller", {})
    gain = lqr_gain(profile)
    if is_default_gain(gain):
        data["controller"].pop("K", None)
        return False
    put(data, "controller.K", gain)
    remarks["controller.K"] = (
        "Designed by heli3dof profile new: LQR of the hover model with two integrals, "
        "Q = diag(100, 1, 10, 0, 0, 2, 10, 0.1), R = 0.05 (24/v_max)²"
    )
    return True


def _loop(talk: Talk, profile: Profile) -> LoopCheck:
    from heli3dof.model.control.loop_check import check_loop_of

    with talk.working("Checking the loop on the rigid body …"):
        return check_loop_of(profile)


def _report(
    talk: Talk, file: Path | None, profile: Profile, found: LoopCheck, **more: Any
) -> list[str]:
    """Show the loop and what is unusual, emit the document, and return what is unusual."""
    from heli3dof.rig.profile_remarks import unusual

    remarks = [*unusual(profile), *found.unusual()]
    talk.show(*_loop_lines(found))
    for remark in remarks:
        talk.warn(remark)
    if not found.stable:
        whose = "default gain" if profile.controller is None else "gain"
        remarks.append(
            f"the {whose} does not stabilise this rig; heli3dof profile new --from FILE designs "
            "another"
        )
        talk.err.print(f"Error: {remarks[-1]}.", soft_wrap=True, style="bold red")
    talk.emit(
        {
            "schema": "heli3dof.profile/1",
            "file": None if file is None else str(file),
            "profile": profile.to_dict(),
            "derived": {n: {"value": v, "unit": u} for n, (v, u, _) in _derived(profile).items()},
            "unusual": remarks,
            "loop": _loop_document(found),
            **more,
        }
    )
    return remarks


def _derived(profile: Profile) -> dict[str, tuple[float, str, str]]:
    """Name → (value, unit, meaning) of what follows from the keys."""
    from heli3dof.axes import AXES
    from heli3dof.rig.profile_remarks import mass_hover_voltage

    follows = "as used by every model"
    out = {
        "T_g": (profile.trim_torque, "N·m", "gravity's torque on the level arm, 2 L_a K_f V_o"),
        "V_o of the masses": (mass_hover_voltage(profile), "V", "hover voltage by their balance"),
    }
    for axis, J in zip(AXES, profile.inertias, strict=True):
        out[f"J_{axis}"] = (J, "kg·m²", f"inertia of the level rig, {follows}")
    limit = profile.motor.K_f * profile.motor.v_max
    out["thrust limit"] = (limit, "N", "of one motor at v_max")
    return out


def _shown(value: Any) -> str:
    if isinstance(value, tuple):
        return "\n".join(" ".join(f"{x:g}" for x in row) for row in value)
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _loop_lines(found: LoopCheck) -> Iterator[str]:
    pole = found.poles[0]
    yield f"Loop: {SIGNS[found.stable]}, rightmost pole {pole.real:+.3f} rad/s"
    if found.disc_margin is not None:
        yield (
            f"Margins at both motors at once: gain × or ÷ {found.gain_margin:.2f}, phase "
            f"{found.phase_margin_deg:.0f}° (disc margin {found.disc_margin:.2f})"
        )
    for s in found.steps:
        yield (
            f"Simulated {s.name.removeprefix('a ')}: {s.axis} peaks at {s.peak_deg:.1f}°, at most "
            f"{s.highest_V:.1f} V"
            + (f", {s.saturated_s:.2f} s at the limit" if s.saturated_s else "")
        )


def _loop_document(found: LoopCheck) -> dict[str, Any]:
    return {
        "stable": found.stable,
        "rightmost_pole_rad_per_s": float(found.poles[0].real),
        "disc_margin": found.disc_margin,
        "gain_margin": found.gain_margin,
        "phase_margin_deg": found.phase_margin_deg,
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
            for s in found.steps
        ],
    }

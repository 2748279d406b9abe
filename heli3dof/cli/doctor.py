"""``doctor``: what is wrong with link, permissions, clock, latency; and what mends it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli.device_option import AnyDevice, the_rig
from heli3dof.cli.options import AsJson, ProfileFile, Quiet
from heli3dof.cli.output import Talk, verb

if TYPE_CHECKING:
    from heli3dof.rig.interface import Check
    from heli3dof.rig.profile import Profile

MARKS = {True: "ok", False: "MEND", None: "?"}


def register(app: typer.Typer) -> None:
    app.command("doctor")(doctor)


@verb
def doctor(
    device: AnyDevice = None,
    profile: ProfileFile = None,
    folder: Annotated[
        Path, typer.Option("--folder", metavar="DIR", help="Where recordings go.")
    ] = Path("flights"),
    arm: Annotated[
        bool,
        typer.Option(
            "--arm", help="Also arm, at zero volts: prove watchdog and emergency stop at work."
        ),
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Check computer, disk, door and rig; say what mends each. Moves nothing."""
    from heli3dof.errors import DeviceError
    from heli3dof.rig.profile import default_profile, load_profile

    talk = Talk(as_json=as_json, quiet=quiet)
    url = the_rig(talk, device)
    rig_profile = load_profile(profile) if profile else default_profile()
    rows: list[tuple[str, Check]] = []
    cannot_open: DeviceError | None = None
    talk.show(f"{url}, profile {rig_profile.name}")
    try:
        for group, check in _checks(url, rig_profile, folder, arm):
            rows.append((group, check))
            _say(talk, check)
    except DeviceError as problem:
        cannot_open = problem
    failed = [check for _, check in rows if check.good is False]
    if cannot_open is not None:
        _say(talk, _as_check(cannot_open))
        rows.append(("rig", _as_check(cannot_open)))
    code = 3 if cannot_open is not None else 6 if failed else 0
    mend = len(failed) + (cannot_open is not None)
    talk.show("Nothing to mend." if not mend else f"To mend: {mend} of {len(rows)}.")
    talk.emit(
        {
            "schema": "heli3dof.doctor/1",
            "device": url,
            "opened": cannot_open is None,
            "checks": [
                {"group": group, "what": c.what, "found": c.found, "good": c.good, "fix": c.fix}
                for group, c in rows
            ],
            "exit_code": code,
        }
    )
    if code:
        raise typer.Exit(code)


def _checks(url: str, profile: Profile, folder: Path, arm: bool) -> Iterator[tuple[str, Check]]:
    from heli3dof.experiment.control_loop.realtime_priority import realtime
    from heli3dof.rig.doctor import armed, host, link
    from heli3dof.rig.doctor import folder as recordings
    from heli3dof.rig.drivers import load_driver
    from heli3dof.rig.session.open_exclusive import hold
    from heli3dof.rig.url import parse_url

    parsed = parse_url(url)
    yield from (("door", check) for check in load_driver(parsed.scheme).examine(parsed))
    yield from (("computer", check) for check in host.checks(profile))
    with realtime() as granted:
        # As a flight will wake up: with whatever is granted to it.
        woke = host.wake_up(profile)
    yield from (("computer", check) for check in (*granted.checks, woke))
    yield from (("recordings", check) for check in recordings.checks(folder))
    with hold(url, profile) as rig, realtime():
        yield from (("rig", check) for check in link.checks(rig, profile))
        if arm:
            yield from (("armed", check) for check in armed.checks(rig, profile))


def _as_check(problem: object) -> Check:
    from heli3dof.errors import DeviceError
    from heli3dof.rig.interface import Check

    assert isinstance(problem, DeviceError)
    found = f"{problem.what} {problem.cause}".strip()
    return Check("opening the rig", found, False, problem.fix)


def _say(talk: Talk, check: Check) -> None:
    """One check: what mends it stands in a line of its own, to be copied. Quiet: failures only."""
    if talk.quiet and check.good is False:
        fix = f" Try: {check.fix}" if check.fix else ""
        talk.fail(f"{check.what}: {check.found}.{fix}")
    talk.show(f"{MARKS[check.good]:4}  {check.what}: {check.found}")
    if check.fix and check.good is not True:
        talk.show(f"      → {check.fix}")

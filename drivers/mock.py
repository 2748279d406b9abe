"""``mock:`` — the emulated rig behind the same port as a real one.

``mock:?profile=P&hide=friction.coulomb.yaw:0.03&seed=1&speed=max``; mock.md lists every
option and effect. Two clocks:

- ``speed=max`` or a number: a virtual clock. Every exchange is one control period of its
  virtual clock, as fast as the machine can or that many times faster than real.
- ``speed=real``: the host keeps time. The device runs on between exchanges; periods that the host
  missed are caught up with the voltage that stood, and the watchdog counts them.

Both integrate whole control periods only, so a flight is the same for the same seed and commands.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from heli3dof.errors import DeviceError, UsageError, did_you_mean
from heli3dof.rig.clock import wait_until
from heli3dof.rig.interface import Check, Command, Identity, Sample

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from .emulator.device import Device
    from .emulator.plant import Truth

OPTIONS = (
    "profile", "hide", "seed", "speed", "noise", "start", "spread", "rate_hz", "watchdog_s",
    "fault",
)  # fmt: skip
LONGEST_CATCH_UP_S = 60.0


class MockDriver:
    """Opens emulated rigs; there is always one to be found."""

    scheme = "mock"
    options: Sequence[str] = OPTIONS
    private_to_process = True
    """See `heli3dof.rig.interface.PrivateToProcess`."""

    def find(self) -> Sequence[str]:
        return ["mock:"]

    def open(self, url: DeviceUrl, profile: Profile) -> MockRig:
        """The emulated rig of the URL; without ``profile=`` it is the rig that the host expects.

        Raises UsageError for an option that makes no sense, ProfileError for a bad profile.
        """
        options = Options.of(url)
        if options.profile is not None:
            from heli3dof.rig.profile import load_profile

            profile = load_profile(options.profile)
        return MockRig(profile, options)

    def estop(self, url: DeviceUrl) -> str:
        """There is no rig outside the process that emulates it."""
        return "an emulated rig lives in the process that flies it: nothing else holds one"

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """The emulated rig needs no permission and no line."""
        return ()


@dataclass(frozen=True)
class Options:
    """The URL's options, checked."""

    profile: str | None = None
    hide: tuple[str, ...] = ()
    seed: int = 0
    speed: float = 1.0
    """times real time; inf: as fast as it can"""
    noise: float = 1.0
    start: Literal["rest", "level"] = "rest"
    spread: float = 0.0
    rate_hz: float | None = None
    watchdog_s: float | None = None
    fault: tuple[str, ...] = ()

    @staticmethod
    def of(url: DeviceUrl) -> Options:
        url.check_options(OPTIONS)
        start = url.one("start", "rest")
        if start not in ("rest", "level"):
            raise UsageError(
                f"{url.text}: start={start} is not a way to start.",
                cause=f"a typing error; {did_you_mean(str(start), ['rest', 'level'])}",
                fix="start=rest (on the table) or start=level (held level until the first command)",
            )
        speed = url.one("speed", "real")
        return Options(
            profile=url.one("profile"),
            hide=url.options.get("hide", ()),
            seed=int(_number(url, "seed", "0", 0, 2**63, whole=True)),
            speed={"real": 1.0, "max": math.inf}.get(str(speed))
            or _number(url, "speed", "real", 0.01, 1e6, also="real or max"),
            noise=_number(url, "noise", "1", 0, 100),
            start="rest" if start == "rest" else "level",
            spread=_number(url, "spread", "0", 0, 0.5),
            rate_hz=_number(url, "rate_hz", "0", 10, 10000) if url.one("rate_hz") else None,
            watchdog_s=_number(url, "watchdog_s", "0", 1e-3, 10) if url.one("watchdog_s") else None,
            fault=url.options.get("fault", ()),
        )


def _number(
    url: DeviceUrl,
    name: str,
    default: str,
    low: float,
    high: float,
    *,
    whole: bool = False,
    also: str = "",
) -> float:
    text = str(url.one(name, default))
    try:
        value = float(int(text)) if whole else float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        kind = "a whole number" if whole else "a number"
        raise UsageError(
            f"{url.text}: {name}={text} is not {kind} from {low:g} to {high:g}"
            + (f", {also}." if also else "."),
            cause="a typing error or another unit.",
            fix=f"--device 'mock:?{name}={default}'",
        )
    return int(text) if whole else value


def device_of(profile: Profile, options: Options) -> Device:
    """The emulated electronics and plant of these options, for every door they stand behind."""
    from .emulator.body import setup_of
    from .emulator.device import WATCHDOG_S, Device
    from .emulator.effect_spec import parse_hide
    from .emulator.faults import Breaking, parse_faults
    from .emulator.plant import Plant

    dt = 1 / (options.rate_hz or profile.loop.rate_hz)
    watchdog_s = options.watchdog_s or max(WATCHDOG_S, 3 * dt)
    if watchdog_s < 2 * dt:
        raise UsageError(
            f"watchdog_s={watchdog_s:g} is shorter than two control periods of {dt:g} s.",
            cause="the watchdog would latch between any two commands.",
            fix=f"watchdog_s={3 * dt:g} or more",
        )
    level = options.start == "level"
    plant = Plant(
        setup_of(profile, options.start),
        profile.encoder.rad_per_count,
        dt=dt,
        hidden=parse_hide(options.hide),
        seed=options.seed,
        noise=options.noise,
        spread=options.spread,
        start_V=profile.motor.V_o if level else 0.0,
    )
    faults = parse_faults(options.fault)
    breaking = Breaking(plant, faults) if faults else plant
    return Device(breaking, v_max=profile.motor.v_max, watchdog_s=watchdog_s, held=level)


class MockRig:
    """An open emulated rig; see `heli3dof.rig.interface.Rig`."""

    def __init__(self, profile: Profile, options: Options | None = None) -> None:
        options = options or Options()
        self._device: Device = device_of(profile, options)
        dt, watchdog_s = self._device.plant.dt, self._device.watchdog_s
        self._dt = dt
        self._real = options.speed == 1.0
        self._pace_s = 0.0 if math.isinf(options.speed) else dt / options.speed
        self._last_s: float | None = None
        self._open = True
        e = profile.encoder
        self._identity = Identity(
            driver="mock",
            model="emulated 3-DOF helicopter",
            serial=f"mock-{options.seed}",
            firmware="emulator 1",
            protocol="in process",
            counts_per_rev=(e.roll, e.pitch, e.yaw),
            v_max=profile.motor.v_max,
            watchdog_s=watchdog_s,
            timebase="host" if self._real else "virtual",
            emulated=True,
        )

    @property
    def identity(self) -> Identity:
        return self._identity

    @property
    def device(self) -> Device:
        """The emulated electronics: for other doors to the same rig."""
        return self._device

    @property
    def device_cause(self) -> str | None:
        """Why the emulated electronics hold their output at zero."""
        cause = self._device.cause
        return cause.name if cause else None

    @property
    def truth(self) -> Truth:
        """The true state and parameters: for tests and benches, never read by heli3dof."""
        return self._device.plant.truth

    def arm(self) -> Sample:
        """Enable at zero volts, clear latches; a rig held level is let go at the first command."""
        self._check_open()
        now = time.monotonic()
        self._catch_up(now)
        self._device.arm()
        self._last_s = now
        return self._sample()

    def read(self) -> Sample:
        """The sample now; where the host keeps time, after the periods that have gone by."""
        self._check_open()
        self._catch_up(time.monotonic())
        return self._sample()

    def exchange(self, command: Command, due_s: float) -> Sample:
        """One control period under the command; see `heli3dof.rig.interface`."""
        self._check_open()
        device = self._device
        if not (math.isfinite(command.v_front) and math.isfinite(command.v_back)):
            device.stop()
            raise DeviceError(
                f"The command {command.sequence} is not a voltage: "
                f"{command.v_front}, {command.v_back}.",
                cause="the controller's output is not finite; the motors were stopped.",
                fix="check the gains and references of this flight",
            )
        if self._real:
            return self._exchange_in_real_time(command, due_s)
        device.command(command.sequence, command.v_front, command.v_back)
        while not device.period():
            pass
        if self._pace_s:
            now = time.monotonic()
            # A slow host delays the virtual clock; it does not have to hurry afterwards.
            last = max(self._last_s or now, now - 2 * self._pace_s)
            self._last_s = wait_until(last + self._pace_s)
        return self._sample()

    def _exchange_in_real_time(self, command: Command, due_s: float) -> Sample:
        device, dt = self._device, self._dt
        now = time.monotonic()
        if self._last_s is None:
            self._last_s = due_s - dt
        if now - self._last_s > device.watchdog_s:
            self._catch_up(now)
        periods = max(1, round((due_s - self._last_s) / dt))
        # A late command finds the old voltage still standing for the periods that have gone by.
        stood = min(int((now - self._last_s) / dt), periods - 1)
        for _ in range(stood):
            device.period()
        device.command(command.sequence, command.v_front, command.v_back)
        arrived = True
        for _ in range(periods - stood):
            arrived = device.period()
        while not arrived:
            periods += 1
            arrived = device.period()
        self._last_s += periods * dt
        wait_until(max(due_s, self._last_s))
        return self._sample()

    def _catch_up(self, now: float) -> None:
        """Let the device run on alone for the whole periods that have gone by (real time only)."""
        if self._real and self._last_s is not None and now > self._last_s:
            gone = int(min(now - self._last_s, LONGEST_CATCH_UP_S) / self._dt)
            for _ in range(gone):
                self._device.period()
            self._last_s = now

    def estop(self, reason: str) -> None:
        """Zero volts now, until `arm`."""
        if self._open:
            self._catch_up(time.monotonic())
            self._device.stop()

    def close(self) -> None:
        if self._open:
            self._device.disable()
            self._open = False

    def _sample(self) -> Sample:
        device = self._device
        return Sample(
            device.sequence,
            device.plant.t,
            device.plant.counts,
            device.v,
            device.current,
            device.flags,
            time.monotonic(),
        )

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError(
                "The emulated rig is closed.",
                cause="close() was called before this.",
                fix="open it again with heli3dof.open_rig",
            )

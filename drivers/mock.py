"""Driver of ``mock:`` URLs: an emulated rig with the same interface as a real one.

``mock:?profile=P&hide=friction.coulomb.yaw:0.03&seed=1&speed=max``; docs/reference/mock.md lists
every option and effect. The option ``speed`` selects the clock:

- ``speed=max`` or a number (times real time): a virtual clock. Each `exchange` (a command, then a
  sample) advances it by a control period, so the same seed and commands give the same samples.
- ``speed=real`` or 1: the host's clock. Between exchanges the device continues: it holds the last
  voltage and simulates the periods that the host missed, so its watchdog may expire.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from heli3dof.errors import UsageError
from heli3dof.rig.clock import wait_until
from heli3dof.rig.interface import Check, Command, Identity, Sample

from .errors import closed, not_a_voltage, watchdog_too_short

if TYPE_CHECKING:
    from heli3dof.rig.interface import Rig
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.sealed_rig import HiddenRig
    from heli3dof.rig.url import DeviceUrl

    from .emulator.device import Device
    from .emulator.endpoint import Endpoint
    from .emulator.plant import Truth
    from .options import MockOptions, RigOptions

LONGEST_CATCH_UP_S = 60.0
"""s: of a longer pause of the host only this time is simulated; then the rig is at rest"""

SEALED = ("profile", "hide", "noise", "noise_s", "vibration_hz", "spread")
"""URL options that ``exercise=`` does not allow: the exercise's sealed file defines the physics"""


class MockDriver:
    """Opens emulated rigs."""

    scheme = "mock"
    options: Sequence[str] = (
        "profile", "hide", "exercise", "seed", "noise", "noise_s", "vibration_hz", "start",
        "spread", "rate_hz", "watchdog_s", "fault", "speed",
    )  # fmt: skip
    """The fields of `MockOptions`, repeated so that `estop` need not import pydantic (slow)"""
    private_to_process = True
    """No other process can reach the rig: see `heli3dof.rig.interface.PrivateToProcess`"""

    def find(self) -> Sequence[str]:
        return ["mock:"]

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Return the emulated rig; ``profile`` applies unless the URL names another profile.

        Raises UsageError for a bad option, ProfileError for a bad profile.
        """
        from .options import MockOptions

        options = MockOptions.of(url)
        return MockRig(own_profile(options, profile), options)

    def estop(self, url: DeviceUrl) -> str:
        """Return a message that there is nothing to stop: no other process can reach this rig."""
        return "an emulated rig exists only in the process that runs it: nothing else to stop"

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """Return no checks: an emulated rig has no port and needs no permission."""
        return ()


def own_profile(options: RigOptions, profile: Profile) -> Profile:
    """Return the emulated rig's profile.

    - With the URL option ``exercise=``: the default profile.
    - Else with the URL option ``profile=``: the profile that the option names.
    - Else: the argument ``profile``.
    """
    if options.exercise is not None:
        from heli3dof.rig.profile import default_profile

        return default_profile()
    if options.profile is None:
        return profile
    from heli3dof.rig.profile import load_profile

    return load_profile(options.profile)


def hidden_rig_of(options: RigOptions) -> HiddenRig | None:
    """Return the rig in the exercise file that ``exercise=`` names; None without this option.

    An exercise is a rig with hidden effects, for students. Raises UsageError if one of the options
    `SEALED`, which change a rig's physics, is also given.
    """
    if options.exercise is None:
        return None
    from heli3dof.rig.sealed_rig import hidden_rig, read_exercise

    for name in SEALED:
        if getattr(options, name) != type(options).model_fields[name].default:
            raise UsageError(
                f"{name}= cannot be combined with exercise=.",
                cause="the exercise defines the rig's physics.",
                fix=f"omit {name}=; seed=, speed= and start= are accepted",
            )
    return hidden_rig(read_exercise(Path(options.exercise)))


def serial_of(options: RigOptions) -> str:
    """Return the emulated rig's serial number: the exercise file's, or ``mock-SEED`` without one.

    An exercise is a rig with hidden effects, for students.
    """
    if options.exercise is None:
        return f"mock-{options.seed}"
    from heli3dof.rig.sealed_rig import read_exercise

    return read_exercise(Path(options.exercise)).serial


def device_of(profile: Profile, options: RigOptions) -> Device:
    """Return an emulated rig's electronics and plant for a profile and the URL's options."""
    from .emulator.body import setup_of
    from .emulator.device import WATCHDOG_S, Device
    from .emulator.effect_spec import parse_hide
    from .emulator.faults import FaultyPlant, parse_faults
    from .emulator.plant import Plant

    sealed = hidden_rig_of(options)
    dt = 1 / (options.rate_hz or profile.loop.rate_hz)
    watchdog_s = options.watchdog_s or max(WATCHDOG_S, 3 * dt)
    if watchdog_s < 2 * dt:
        raise watchdog_too_short(watchdog_s, dt)
    level = options.start == "level"
    plant = Plant(
        setup_of(profile, options.start),
        profile.encoder.rad_per_count,
        dt=dt,
        hidden=parse_hide((sealed.hide,) if sealed else options.hide),
        seed=options.seed,
        noise=options.noise,
        noise_s=options.noise_s,
        vibration_hz=options.vibration_hz,
        spread=sealed.spread if sealed else options.spread,
        spread_seed=sealed.rig_seed if sealed else None,
        start_V=profile.motor.V_o if level else 0.0,
    )
    faults = parse_faults(options.fault)
    breaking = FaultyPlant(plant, faults) if faults else plant
    return Device(breaking, v_max=profile.motor.v_max, watchdog_s=watchdog_s, held=level)


def endpoint_of(profile: Profile, options: RigOptions) -> Endpoint:
    """Return an emulated rig behind the link protocol, for a profile and the URL's options."""
    from .emulator.endpoint import Endpoint

    e = profile.encoder
    return Endpoint(
        device_of(profile, options),
        counts_per_rev=(e.roll, e.pitch, e.yaw),
        serial=serial_of(options),
        boot=int.from_bytes(os.urandom(4), "little"),
    )


class MockRig:
    """The emulated rig of a ``mock:`` URL; implements `heli3dof.rig.interface.Rig`."""

    def __init__(self, profile: Profile, options: MockOptions | None = None) -> None:
        if options is None:
            from .options import MockOptions

            options = MockOptions()
        self.device: Device = device_of(profile, options)
        """The emulated electronics, for tests and other transports"""
        dt, watchdog_s = self.device.plant.dt, self.device.watchdog_s
        self._dt = dt
        self._real = options.speed == 1.0
        self._pace_s = 0.0 if math.isinf(options.speed) else dt / options.speed
        self._last_s: float | None = None
        self._open = True
        self._is_sealed = options.exercise is not None
        e = profile.encoder
        self._identity = Identity(
            driver="mock",
            model="emulated 3-DOF helicopter",
            serial=serial_of(options),
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
    def device_cause(self) -> str | None:
        """Return why the emulated electronics hold their output at zero; None if they do not."""
        cause = self.device.cause
        return cause.name if cause else None

    @property
    def truth(self) -> Truth:
        """Return the true state and parameters, for tests; heli3dof itself never reads them.

        Raises UsageError for the rig of an exercise, whose effects stay hidden.
        """
        if self._is_sealed:
            raise UsageError(
                "A sealed rig does not state its truth.",
                cause="it belongs to an exercise.",
                fix="the teacher opens it: heli3dof exercise open",
            )
        return self.device.plant.truth

    def arm(self) -> Sample:
        """Enable the output at zero volts, clear every stop, and return the first sample.

        With the URL option ``start=level``, the emulator holds the rig level until the first
        voltage command (`exchange`) after the arming.
        """
        self._check_open()
        now = time.monotonic()
        self._catch_up(now)
        self.device.arm()
        self._last_s = now
        return self._sample()

    def read(self) -> Sample:
        """Return a sample without sending a command.

        With ``speed=real``, the rig first simulates the time since the last call. With any other
        speed the clock is virtual, and this call does not advance it.
        """
        self._check_open()
        self._catch_up(time.monotonic())
        return self._sample()

    def exchange(self, command: Command, due_s: float) -> Sample:
        """Apply a command for one control period and return the sample at the period's end.

        If this sample is lost (`timing.gaps`), the next one is returned. ``due_s``: end of the
        period in s on the host's monotonic clock, used with ``speed=real``.
        """
        self._check_open()
        device = self.device
        if not (math.isfinite(command.v_front) and math.isfinite(command.v_back)):
            device.stop()
            raise not_a_voltage(command.sequence, command.v_front, command.v_back)
        if self._real:
            return self._exchange_in_real_time(command, due_s)
        device.command(command.sequence, command.v_front, command.v_back)
        while not device.period():
            pass
        if self._pace_s:
            now = time.monotonic()
            # A slow host delays the virtual clock; later periods do not make up for it.
            last = max(self._last_s or now, now - 2 * self._pace_s)
            self._last_s = wait_until(last + self._pace_s)
        return self._sample()

    def _exchange_in_real_time(self, command: Command, due_s: float) -> Sample:
        device, dt = self.device, self._dt
        now = time.monotonic()
        if self._last_s is None:
            self._last_s = due_s - dt
        if now - self._last_s > device.watchdog_s:
            self._catch_up(now)
        periods = max(1, round((due_s - self._last_s) / dt))
        # A late command: the old voltage was held in the periods that have passed.
        held = min(int((now - self._last_s) / dt), periods - 1)
        for _ in range(held):
            device.period()
        device.command(command.sequence, command.v_front, command.v_back)
        arrived = True
        for _ in range(periods - held):
            arrived = device.period()
        while not arrived:
            periods += 1
            arrived = device.period()
        self._last_s += periods * dt
        wait_until(max(due_s, self._last_s))
        return self._sample()

    def _catch_up(self, now: float) -> None:
        """If ``speed=real``, simulate the periods from the last call to ``now`` (host time, s)."""
        if self._real and self._last_s is not None and now > self._last_s:
            passed = int(min(now - self._last_s, LONGEST_CATCH_UP_S) / self._dt)
            for _ in range(passed):
                self.device.period()
            self._last_s = now

    def estop(self, reason: str) -> None:
        """Set the output to zero volts until the next `arm`; ``reason`` is not used."""
        if self._open:
            self._catch_up(time.monotonic())
            self.device.stop()

    def close(self) -> None:
        if self._open:
            self.device.disable()
            self._open = False

    def _sample(self) -> Sample:
        device = self.device
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
            raise closed("The emulated rig")

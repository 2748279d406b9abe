"""An emulated USB bus: a backend for pyusb, without libusb and without hardware.

The URL option ``bus=KIND@SECONDS[:FOR_SECONDS]`` adds a fault of the bus; `KINDS` lists the kinds.
The option may be repeated. Two open handles of one rig act as two processes: only one can claim the
USB interface.
"""

from __future__ import annotations

import errno
import functools
import struct
import threading
import time
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NoReturn, TypeVar

import usb.backend
import usb.core

from heli3dof.errors import UsageError, did_you_mean

from .usb_function import CONFIGURATION, DEVICE, IN, OUT, UsbFunction

KINDS = {
    "unplug": ("unplug@3:1", "The cable is unplugged for 1 s; without a duration: for good."),
    "stall_in": (
        "stall_in@3",
        "The pipe to the host halts; with a duration, again after each clearing.",
    ),
    "stall_out": ("stall_out@3:1", "The same, for the pipe to the rig."),
    "silent": ("silent@3:0.1", "No transfer on the pipes completes for 0.1 s."),
    "refused": ("refused@0", "This user has no permission to open the rig."),
}
"""Kind → example and effect: the table in docs/reference/mock.md"""
_DEVICE = (
    "bLength bDescriptorType bcdUSB bDeviceClass bDeviceSubClass bDeviceProtocol bMaxPacketSize0 "
    "idVendor idProduct bcdDevice iManufacturer iProduct iSerialNumber bNumConfigurations"
)
_CONFIGURATION = (
    "bLength bDescriptorType wTotalLength bNumInterfaces bConfigurationValue iConfiguration "
    "bmAttributes bMaxPower"
)
_INTERFACE = (
    "bLength bDescriptorType bInterfaceNumber bAlternateSetting bNumEndpoints bInterfaceClass "
    "bInterfaceSubClass bInterfaceProtocol iInterface"
)
_ENDPOINT = "bLength bDescriptorType bEndpointAddress bmAttributes wMaxPacketSize bInterval"


@dataclass(frozen=True, slots=True)
class BusFault:
    """A fault of the emulated bus, from ``at_s`` s after the bus's creation, for ``for_s`` s.

    If ``for_s`` is None, the fault is permanent, except that the host can clear a stalled pipe.
    """

    kind: str
    at_s: float = 0.0
    for_s: float | None = None

    @staticmethod
    def of(text: str) -> BusFault:
        """Return the fault that ``text``, a value of ``bus=``, describes.

        Raises UsageError if it describes none.

        >>> BusFault.of("silent@1:0.5")
        BusFault(kind='silent', at_s=1.0, for_s=0.5)
        """
        kind, _, when = text.partition("@")
        times = when.split(":")
        try:
            numbers = [float(t) for t in times]
        except ValueError:
            numbers = [-1.0]
        if kind not in KINDS or len(numbers) > 2 or not all(0 <= n < 1e6 for n in numbers):
            raise UsageError(
                f"bus={text} is not a fault of a USB bus.",
                cause=f"a fault is KIND@SECONDS or KIND@SECONDS:FOR; {did_you_mean(kind, KINDS)}",
                fix="bus=unplug@2",
            )
        return BusFault(kind, *numbers)


@dataclass(eq=False)
class RigOnBus:
    """An emulated rig on the emulated USB bus, with the bus faults that the emulator injects."""

    function: UsbFunction
    faults: Sequence[BusFault] = ()
    plugged: bool = True
    refused: bool = False
    claimed_by: Any = None
    plugs: int = 0
    """How often the rig was plugged in again; each time makes earlier handles invalid"""


@dataclass(eq=False)
class Handle:
    rig: RigOnBus
    plugs: int


F = TypeVar("F", bound=Callable[..., Any])


def locked(method: F) -> F:
    """Decorator for methods of `EmulatedBus`: hold the bus's lock while the method runs."""

    @functools.wraps(method)
    def method_with_lock(self: EmulatedBus, *args: Any, **named: Any) -> Any:
        with self._lock:
            return method(self, *args, **named)

    return method_with_lock  # type: ignore[return-value]


class EmulatedBus(usb.backend.IBackend):  # type: ignore[misc]
    """USB bus without hardware, for pyusb: its only devices are emulated rigs."""

    def __init__(self, rigs: Iterable[RigOnBus]) -> None:
        super().__init__()
        self.rigs = list(rigs)
        self._began = time.monotonic()
        # The host reads in one thread and writes in another; a write may end a read.
        self._lock = threading.Condition(threading.RLock())

    @locked
    def unplug(self, rig: RigOnBus) -> None:
        if rig.plugged:
            rig.plugged, rig.claimed_by = False, None
            rig.function.lost(self.now_us())

    @locked
    def plug(self, rig: RigOnBus) -> None:
        if not rig.plugged:
            rig.plugged = True
            rig.plugs += 1
            rig.function.configuration = 1

    def now_us(self) -> int:
        """Return the time on the devices' clock: µs since the bus was created."""
        return int((time.monotonic() - self._began) * 1e6)

    def _apply_faults(self) -> None:
        t = time.monotonic() - self._began
        for rig in self.rigs:
            waiting = []
            for fault in rig.faults:
                if t < fault.at_s:
                    waiting.append(fault)
                elif fault.for_s is None or t < fault.at_s + fault.for_s:
                    self._begin(rig, fault)
                    if fault.for_s is not None:
                        waiting.append(fault)
                else:
                    self._end(rig, fault)
            rig.faults = waiting

    def _begin(self, rig: RigOnBus, fault: BusFault) -> None:
        function, pipe = rig.function, IN if fault.kind == "stall_in" else OUT
        match fault.kind:
            case "unplug":
                self.unplug(rig)
            case "silent":
                function.silent = True
            case "refused":
                rig.refused = True
            case _:
                (function.halted if fault.for_s is None else function.stuck).add(pipe)

    def _end(self, rig: RigOnBus, fault: BusFault) -> None:
        match fault.kind:
            case "unplug":
                self.unplug(rig)  # in case no call came while it was unplugged
                self.plug(rig)
            case "silent":
                rig.function.silent = False
            case "refused":
                rig.refused = False
            case _:
                rig.function.stuck.discard(IN if fault.kind == "stall_in" else OUT)

    # The methods of a pyusb backend

    @locked
    def enumerate_devices(self) -> list[RigOnBus]:
        self._apply_faults()
        return [r for r in self.rigs if r.plugged]

    def get_parent(self, dev: RigOnBus) -> None:
        return None

    def get_device_descriptor(self, dev: RigOnBus) -> SimpleNamespace:
        address = self.rigs.index(dev) + 1
        place = {"bus": 0, "address": address, "port_number": address, "port_numbers": (address,)}
        return _named(_DEVICE, "<BBHBBBBHHHBBBB", DEVICE, speed=3, **place)

    def get_configuration_descriptor(self, dev: RigOnBus, config: int) -> SimpleNamespace:
        if config:
            raise IndexError(f"there is no configuration {config}")
        return _named(_CONFIGURATION, "<BBHBBBBB", CONFIGURATION)

    def get_interface_descriptor(
        self, dev: RigOnBus, intf: int, alt: int, config: int
    ) -> SimpleNamespace:
        if intf or alt or config:
            raise IndexError(f"there is no interface {intf}.{alt}")
        return _named(_INTERFACE, "<9B", CONFIGURATION[9:])

    def get_endpoint_descriptor(
        self, dev: RigOnBus, ep: int, intf: int, alt: int, config: int
    ) -> SimpleNamespace:
        extra = {"bRefresh": 0, "bSynchAddress": 0}
        return _named(_ENDPOINT, "<BBBBHB", CONFIGURATION[18 + 7 * ep :], **extra)

    @locked
    def open_device(self, dev: RigOnBus) -> Handle:
        self._apply_faults()
        if not dev.plugged:
            _fail(errno.ENODEV)
        if dev.refused:
            _fail(errno.EACCES)
        return Handle(dev, dev.plugs)

    def close_device(self, dev_handle: Handle) -> None:
        self.release_interface(dev_handle, 0)

    @locked
    def claim_interface(self, dev_handle: Handle, intf: int) -> None:
        rig = self._reach(dev_handle)
        if rig.claimed_by not in (None, dev_handle):
            _fail(errno.EBUSY)
        rig.claimed_by = dev_handle

    @locked
    def release_interface(self, dev_handle: Handle, intf: int) -> None:
        if dev_handle.rig.claimed_by is dev_handle:
            dev_handle.rig.claimed_by = None

    def is_kernel_driver_active(self, dev_handle: Handle, intf: int) -> bool:
        return False

    @locked
    def set_configuration(self, dev_handle: Handle, config_value: int) -> None:
        self._reach(dev_handle).function.configure(self.now_us(), config_value)

    def get_configuration(self, dev_handle: Handle) -> int:
        return self._reach(dev_handle).function.configuration

    @locked
    def clear_halt(self, dev_handle: Handle, ep: int) -> None:
        self._reach(dev_handle).function.halted.discard(ep)

    @locked
    def ctrl_transfer(
        self, dev_handle: Handle, bmRequestType: int, bRequest: int, wValue: int, wIndex: int,
        data: Any, timeout: int,
    ) -> int:  # fmt: skip
        function = self._reach(dev_handle).function
        reply = function.control(self.now_us(), bmRequestType, bRequest, wValue)
        if reply is None:
            _fail(errno.EPIPE)
        reply = reply[: len(data)]
        data[: len(reply)] = array("B", reply)
        return len(reply)

    @locked
    def bulk_write(self, dev_handle: Handle, ep: int, intf: int, data: Any, timeout: int) -> int:
        deadline = time.monotonic() + timeout / 1000
        while True:
            function = self._claimed(dev_handle)
            taken = function.receive(self.now_us(), data.tobytes())
            if taken:
                self._lock.notify_all()
                return len(data)
            if taken is None:
                _fail(errno.EPIPE)
            self._wait(function, deadline)

    @locked
    def bulk_read(self, dev_handle: Handle, ep: int, intf: int, buff: Any, timeout: int) -> int:
        deadline = time.monotonic() + timeout / 1000
        while True:
            function = self._claimed(dev_handle)
            given = function.send(self.now_us(), len(buff))
            if given:
                buff[: len(given)] = array("B", given)
                return len(given)
            if given is None:
                _fail(errno.EPIPE)
            self._wait(function, deadline)

    def _reach(self, handle: Handle) -> RigOnBus:
        self._apply_faults()
        if not handle.rig.plugged or handle.plugs != handle.rig.plugs:
            _fail(errno.ENODEV)
        return handle.rig

    def _claimed(self, handle: Handle) -> UsbFunction:
        rig = self._reach(handle)
        if rig.claimed_by is not handle:
            _fail(errno.EBUSY)
        return rig.function

    def _wait(self, function: UsbFunction, deadline: float) -> None:
        """Wait until the rig has data or room for a bulk transfer, but at most 10 ms.

        ``function``: the rig's USB function.

        Raises USBTimeoutError if ``deadline`` (s, host's monotonic clock) has passed.
        """
        now = time.monotonic()
        if now >= deadline:
            raise usb.core.USBTimeoutError("Operation timed out", errno=errno.ETIMEDOUT)
        due = function.endpoint.next_us()
        soon = now + 0.01 if due is None or function.silent else self._began + due / 1e6
        self._lock.wait(min(deadline, max(soon, now + 20e-6), now + 0.01) - now)


def _fail(number: int) -> NoReturn:
    raise usb.core.USBError(errno.errorcode[number], errno=number)


def _named(names: str, layout: str, data: bytes, **more: Any) -> SimpleNamespace:
    values = dict(zip(names.split(), struct.unpack_from(layout, data), strict=True))
    return SimpleNamespace(**values, **more, extra_descriptors=[])

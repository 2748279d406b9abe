"""Every case of the driver conformance suite (`heli3dof.rig.conformance`) on the kernel's stack."""

from __future__ import annotations

import sys
import unittest
from importlib.metadata import EntryPoint
from types import ModuleType
from typing import Any

from . import cases_serial, cases_usb
from .guest import PROFILE, case

DRIVERS = {
    "usb": "heli3dof_drivers.usb_bulk:UsbDriver",
    "serial": "heli3dof_drivers.serial_port:SerialDriver",
}
NEEDS_A_BODY_THAT_MOVES = (
    "equal_voltages_lift_the_body_and_a_larger_front_voltage_raises_the_front",
)  # the guest's rig has no body


def suite() -> Any:
    """The cases, and the function to run one. Replaces numpy and the entry points."""
    from heli3dof.rig import drivers

    profile: Any = ModuleType("heli3dof.rig.profile")
    profile.Profile, profile.default_profile = object, lambda: PROFILE
    sys.modules.setdefault("heli3dof.rig.profile", profile)
    drivers.registered = lambda: {  # type: ignore[assignment]
        name: EntryPoint(name, value, drivers.GROUP) for name, value in DRIVERS.items()
    }
    from heli3dof.rig.conformance import CASES, conforms

    return CASES, conforms


def conformance(url: str) -> dict[str, Any]:
    cases, conforms = suite()
    held, skipped, failed = 0, [], {}
    assert set(NEEDS_A_BODY_THAT_MOVES) <= {str(one) for one in cases}
    for one in cases:
        if str(one) in NEEDS_A_BODY_THAT_MOVES:
            continue
        try:
            conforms(one, url, PROFILE, moves=True)
            held += 1
        except unittest.SkipTest:
            skipped.append(str(one))
        except Exception as error:
            failed[str(one)] = f"{type(error).__name__}: {error}"
    assert not failed, failed
    assert held > 20, held
    return {"held": held, "skipped": ", ".join(skipped)}


@case
def conformance_of_usb() -> dict[str, Any]:
    cases_usb.hand()
    return conformance(cases_usb.URL)


@case
def conformance_of_serial() -> dict[str, Any]:
    cases_serial.hand()
    return conformance(cases_serial.URL)

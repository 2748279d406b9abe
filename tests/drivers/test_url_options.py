"""Every driver's option model: unknown options, bounds, repeated options, and the option table."""

from __future__ import annotations

import math

import pytest
from heli3dof_drivers.options import (
    MockOptions,
    SerialOptions,
    UrlOptions,
    UsbMockOptions,
    UsbOptions,
)
from heli3dof_drivers.quanser_hil.wiring import Wiring

from heli3dof.errors import UsageError
from heli3dof.rig.drivers import load_driver
from heli3dof.rig.url import parse_url

MODELS: dict[str, type[UrlOptions]] = {
    "mock": MockOptions, "serial": SerialOptions, "usb": UsbOptions, "usb+mock": UsbMockOptions,
    "quanser": Wiring,
}  # fmt: skip


@pytest.mark.parametrize("scheme", MODELS)
def test_a_driver_lists_the_options_of_its_model_and_names_the_nearest(scheme: str) -> None:
    model = MODELS[scheme]
    assert set(load_driver(scheme).options) == set(model.names())
    with pytest.raises(UsageError, match="did you mean 'watchdog_s'"):
        model.of(parse_url(f"{scheme}://b/0?wachdog_s=0.1"))


@pytest.mark.parametrize("scheme", MODELS)
def test_every_option_has_a_description_and_its_shown_default_is_valid(scheme: str) -> None:
    model = MODELS[scheme]
    for name, default, description in model.rows():
        assert description
        if default not in ("None", "()"):
            model.of(parse_url(f"{scheme}://b/0?{name}={default}"))


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("mock:?seed=1.5", "seed=1.5 is not a whole number from 0 to"),
        ("mock:?speed=inf", "speed=inf is not a number from 0.01 to 1e+06, real or max"),
        ("serial://p?baud=9", "baud=9 is not a number from 1200 to 1.2e+07"),
        ("serial://p?stream=2", "stream=2 is not one of 1, 0"),
        ("usb:?timeout_s=0", "timeout_s=0 is not a number from 0.001 to 10"),
        ("usb+mock:?watchdog_s=2", "watchdog_s=2 is not a number from 0.001 to 1"),
    ],
)
def test_a_value_out_of_bounds_is_named_with_its_bounds(url: str, message: str) -> None:
    parsed = parse_url(url)
    with pytest.raises(UsageError) as caught:
        MODELS[parsed.scheme].of(parsed)
    assert message in caught.value.what
    assert caught.value.fix


def test_repeated_options_are_collected_or_the_last_one_counts() -> None:
    options = MockOptions.of(parse_url("mock:?hide=a:1&hide=b:2&seed=1&seed=2&speed=max&rate_hz="))
    assert (options.hide, options.seed, options.rate_hz) == (("a:1", "b:2"), 2, None)
    assert options.speed == math.inf


def test_options_without_a_question_mark_are_refused() -> None:
    with pytest.raises(UsageError, match="need a question mark") as caught:
        parse_url("mock:speed=max&hide=motor.lag:0.1")
    assert "'mock:?speed=max&hide=motor.lag:0.1'" in caught.value.fix

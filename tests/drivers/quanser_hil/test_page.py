"""docs/how-to/quanser.md has every option, with the default that the driver has."""

from __future__ import annotations

import re

import pytest
from heli3dof_drivers.quanser_hil import wiring

from heli3dof.rig.url import parse_url
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "how-to" / "quanser.md").read_text(encoding="utf-8")


def table() -> dict[str, str]:
    """Option → default, from the page."""
    result = {}
    for names, defaults in re.findall(r"^\| (`.*?`) \| (.*?) \|", PAGE, re.MULTILINE):
        options = re.findall(r"`(\w+)`", names)
        values = defaults.split(", ") if len(options) > 1 else [defaults]
        result |= dict(zip(options, values, strict=True))
    return result


def test_every_option_is_on_the_page() -> None:
    assert set(table()) == set(wiring.Wiring.names())


@pytest.mark.parametrize(("option", "default"), table().items())
def test_a_default_on_the_page_changes_nothing(option: str, default: str) -> None:
    plain = wiring.Wiring.of(parse_url("quanser://q8_usb/0"))
    assert wiring.Wiring.of(parse_url(f"quanser://q8_usb/0?{option}={default}")) == plain


def test_the_models_table_has_the_defaults_of_the_page() -> None:
    assert {name: default for name, default, _ in wiring.Wiring.rows()} == table()


def test_the_examples_are_valid() -> None:
    examples = re.findall(r"`(quanser://\S+\?\S+)`", PAGE)
    assert examples
    for example in examples:
        wiring.Wiring.of(parse_url(example))

"""The benchmark page is rendered from the measured figures, never typed."""

from __future__ import annotations

import importlib
import json

import pytest

from tests.bench.__main__ import PAGE, STORE, render, topics


def test_the_page_is_what_the_figures_render_to() -> None:
    store = json.loads(STORE.read_text(encoding="utf-8"))
    assert PAGE.read_text(encoding="utf-8") == render(store)


@pytest.mark.parametrize("topic", topics())
def test_every_bench_has_a_title_and_a_measurement(topic: str) -> None:
    bench = importlib.import_module(f"tests.bench.bench_{topic}")
    assert bench.TITLE
    assert callable(bench.measure)

"""The benchmark page is rendered from the measured figures, never typed."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from tests.bench import page
from tests.bench.__main__ import topics


@pytest.mark.parametrize("path", sorted(page.pages(page.load())), ids=lambda p: p.name)
def test_a_page_of_results_is_rendered_from_the_figures(path: Path) -> None:
    made = page.pages(page.load())[path]
    assert path.read_text(encoding="utf-8") == made, "run: python -m tests.bench.page"


def test_no_row_of_the_page_was_measured_on_a_changed_tree() -> None:
    assert "-dirty" not in page.render(page.load())


@pytest.mark.parametrize("topic", topics())
def test_every_bench_has_a_title_and_a_measurement(topic: str) -> None:
    bench = importlib.import_module(f"tests.bench.bench_{topic}")
    assert bench.TITLE
    assert callable(bench.measure)

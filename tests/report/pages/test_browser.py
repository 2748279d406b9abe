"""The report in headless Chromium: figures, zoom, widths, contrast, print (`make test-browser`)."""

from __future__ import annotations

import itertools
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heli3dof.comparison.compare import compare
from heli3dof.model.linear.hover import hover_model
from heli3dof.paper.reproduction import reproduce
from heli3dof.report.figures.diagnosis_data import FigureData
from heli3dof.report.figures.torque_curve import TorqueCurve
from heli3dof.report.pages.flight_report import Diagnosed, flight_report
from heli3dof.report.pages.html import write_page
from heli3dof.rig.profile import default_profile
from tests.comparison.fakes import FakeHover, flight
from tests.report.text.test_diagnosis_tables import DOCUMENT

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = [
    pytest.mark.skipif("HELI3DOF_BROWSER" not in os.environ, reason="run by make test-browser"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium"),
]
MOST_BYTES = 3e6
AA, AA_LARGE = 4.5, 3.0
"""Least contrast of text by WCAG 2 level AA; large: from 24 px, or 18.66 px bold"""
CONTRASTS = """() => {
  const rgba = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const behind = (e) => {
    for (; e; e = e.parentElement) {
      const color = rgba(getComputedStyle(e).backgroundColor);
      if (color.length === 3 || color[3] === 1) return color;
    }
    return [255, 255, 255];
  };
  const found = [];
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !e.checkVisibility() || e.tagName === "SCRIPT") continue;
    const style = getComputedStyle(e);
    const [a, b] = [light(rgba(style.color)), light(behind(e))].sort((x, y) => y - x);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    found.push([(a + 0.05) / (b + 0.05), large, e.tagName + ": " + e.textContent.slice(0, 40)]);
  }
  return found;
}"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recording = flight(truth=FakeHover(thrust=0.8), noise_deg=0.05)
    models = [hover_model(default_profile()), hover_model(default_profile(), printed=True)]
    z = np.linspace(-20.0, 20.0, 9)
    torque = -0.03 * np.sign(z)
    data = FigureData(
        evidence=[TorqueCurve("friction.coulomb.yaw", "yaw", "yaw_rate", "°/s", z, torque,
                              0.01 + 0 * z, z, torque)]
    )  # fmt: skip
    text = flight_report(
        [recording],
        models=models,
        comparison=compare([recording], models),
        diagnosed=Diagnosed(DOCUMENT, data),
        reproduced=reproduce(models[0]),
    )
    return write_page(text, tmp_path_factory.mktemp("report") / "report.html")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


def shown(browser: Any, report: Path, width: int = 1300, **options: Any) -> Any:
    """The page with all details open and all figures drawn; its console errors are in `.errors`."""
    page = browser.new_page(viewport={"width": width, "height": 900}, **options)
    page.errors = []
    page.on("console", lambda m: page.errors.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda e: page.errors.append(str(e)))
    page.goto(report.as_uri())
    if options.get("java_script_enabled", True):
        page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        for figure in page.query_selector_all("figure:has(> script)"):
            figure.scroll_into_view_if_needed()
            figure.wait_for_selector("canvas")
        page.evaluate("scrollTo(0, 0)")
    return page


@pytest.fixture(scope="module")
def wide(browser: Any, report: Path) -> Any:
    return shown(browser, report)


def ranges(page: Any, alt: str) -> list[list[float]]:
    """The visible range of the horizontal axis of each plot of the figure with this text."""
    found: list[list[float]] = page.evaluate(
        "(alt) => [...document.querySelectorAll('figure.drawn')]"
        ".filter((f) => f.querySelector('img').alt.includes(alt)).flatMap((f) => f.plots)"
        ".map((u) => [u.scales.x.min, u.scales.x.max])",
        alt,
    )
    return found


def test_every_figure_is_drawn_without_an_error(wide: Any, report: Path) -> None:
    assert wide.errors == []
    assert wide.locator("figure.drawn").count() == wide.locator("figure:has(> img)").count() >= 7
    painted = wide.evaluate(
        "[...document.querySelectorAll('canvas')].map((c) => c.getContext('2d')"
        ".getImageData(0, 0, c.width, c.height).data.some((v) => v))"
    )
    assert all(painted)
    assert report.stat().st_size < MOST_BYTES


def test_a_zoom_moves_all_figures_of_the_flight_and_no_other(browser: Any, report: Path) -> None:
    page = shown(browser, report)
    other = ranges(page, "Magnitude and phase")
    plot = page.locator("figure:has(> img[alt^='Figure 7']) .u-over")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.25 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], middle, steps=5)
    page.mouse.up()
    page.wait_for_timeout(50)
    zoomed = ranges(page, "Figure 7")[0]
    assert zoomed == pytest.approx([2.5, 5.0], abs=0.1)
    for alt in ("Figure 8", "Figure 9", "Angles and voltages"):
        assert all(r == zoomed for r in ranges(page, alt)), alt
    assert ranges(page, "Magnitude and phase") == other
    plot.dblclick()
    page.wait_for_timeout(50)
    assert ranges(page, "Figure 8")[0] == pytest.approx([0.0, 10.0], abs=0.01)


def test_keys_read_values_and_zoom(browser: Any, report: Path) -> None:
    page = shown(browser, report)
    plot = page.locator("figure:has(> img[alt^='Figure 7']) .u-over")
    plot.focus()
    page.keyboard.press("ArrowRight")
    values = page.locator("figure:has(> img[alt^='Figure 7']) .u-value").all_inner_texts()
    assert float(values[0]) == pytest.approx(5.0, abs=0.2)
    assert all(v not in ("", "–") for v in values[:4])
    page.keyboard.press("+")
    page.wait_for_timeout(50)
    low, high = ranges(page, "Figure 7")[0]
    assert high - low == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("width", [400, 1300])
def test_nothing_is_wider_than_the_window(browser: Any, report: Path, width: int) -> None:
    page = shown(browser, report, width)
    assert page.evaluate("document.documentElement.scrollWidth") == width


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_the_contrast_of_wcag_aa(browser: Any, report: Path, scheme: str) -> None:
    page = shown(browser, report, color_scheme=scheme)
    found = page.evaluate(CONTRASTS)
    assert len(found) > 200
    faint = [(ratio, text) for ratio, large, text in found if ratio < (AA_LARGE if large else AA)]
    assert faint == []


def test_a_change_of_theme_draws_the_figures_again(browser: Any, report: Path) -> None:
    page = shown(browser, report)
    count = page.locator("canvas").count()
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(100)
    assert page.locator("canvas").count() == count
    assert page.errors == []


def test_links_headings_and_alternative_texts(wide: Any) -> None:
    targets = wide.evaluate("[...document.querySelectorAll('a')].map((a) => a.hash.slice(1))")
    assert targets
    assert all(wide.locator(f"[id='{t}']").count() == 1 for t in targets)
    levels = wide.evaluate(
        "[...document.querySelectorAll('h1,h2,h3,h4')].map((h) => Number(h.tagName[1]))"
    )
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b <= a + 1 for a, b in itertools.pairwise(levels))
    assert wide.evaluate("document.documentElement.lang") == "en"
    assert wide.locator("img:not([alt]), img[alt='']").count() == 0


def test_the_tab_key_reaches_every_fold_and_shows_the_focus(browser: Any, report: Path) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
    reached = set()
    for _ in range(100):
        page.keyboard.press("Tab")
        tag, width = page.evaluate(
            "[document.activeElement.tagName + document.activeElement.innerText,"
            " getComputedStyle(document.activeElement).outlineWidth]"
        )
        if tag.startswith("SUMMARY"):
            reached.add(page.evaluate("document.activeElement.closest('section').id"))
        if tag.startswith("BODY"):
            break
        assert width != "0px", tag
    assert len(reached) == page.locator("summary").count()


def test_without_scripts_the_static_pictures_show(browser: Any, report: Path) -> None:
    page = shown(browser, report, java_script_enabled=False)
    images = page.locator(".answers img")
    assert images.count() > 0
    assert all(image.is_visible() for image in images.all())
    assert page.locator("canvas").count() == 0


def test_paper_shows_the_static_pictures_on_white(browser: Any, report: Path) -> None:
    page = shown(browser, report, color_scheme="dark")
    page.emulate_media(media="print", color_scheme="dark")
    assert not page.locator(".live").first.is_visible()
    assert page.locator("figure > img").first.is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"


def test_printing_opens_the_folds_and_closes_them_again(browser: Any, report: Path) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
    page.evaluate(
        "addEventListener('beforeprint', () => {"
        " window.printed = document.querySelectorAll('details:not([open])').length; })"
    )
    page.pdf()
    assert page.evaluate("window.printed") == 0
    assert page.locator("details[open]").count() == 0

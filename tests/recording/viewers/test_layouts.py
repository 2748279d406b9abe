"""The layouts for Foxglove and PlotJuggler name topics and fields that the files contain."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

from heli3dof.recording.logs.export import layout
from heli3dof.recording.mcap_files.schema import COMMAND, SAMPLE
from heli3dof.recording.viewers.foxglove_file import TOPICS

FIELDS = {f"{x.topic}/{column.name}" for x in (SAMPLE, COMMAND) for column in x.columns}


def test_plotjuggler_plots_columns_of_a_recording() -> None:
    root = ElementTree.fromstring(layout("plotjuggler_layout.xml"))
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    assert set(curves) <= FIELDS
    assert {f"/heli3dof/sample/{axis}_rad" for axis in ("roll", "pitch", "yaw")} < set(curves)


def test_plotjuggler_s_splitters_count_their_areas() -> None:
    root = ElementTree.fromstring(layout("plotjuggler_layout.xml"))
    assert root.tag == "root"
    splitters = list(root.iter("DockSplitter"))
    assert len(splitters) == len(list(root.iter("Tab"))) == 2
    for splitter in splitters:
        assert int(splitter.attrib["count"]) == len(splitter.findall("DockArea/plot"))
        sizes = [float(size) for size in splitter.attrib["sizes"].split(";")]
        assert len(sizes) == len(splitter)
        assert abs(sum(sizes) - 1) < 1e-3


def test_foxglove_s_panels_are_those_in_its_arrangement() -> None:
    found = json.loads(layout("foxglove_layout.json"))
    assert sorted(panels(found["layout"])) == sorted(found["configById"])


def test_foxglove_shows_topics_of_the_exported_file() -> None:
    configs = json.loads(layout("foxglove_layout.json"))["configById"]
    paths = [path["value"] for c in configs.values() for path in c.get("paths", ())]
    plain = {re.sub(r"\.@rad2deg$", "", path).replace(".", "/") for path in paths}
    assert plain <= FIELDS
    shown = {topic for c in configs.values() for topic in c.get("topics", ())}
    assert shown | {configs["RosOut!log"]["topicToRender"]} == set(TOPICS)


def panels(node: Any) -> Iterator[str]:
    """The panels in a tree of splits."""
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node["first"])
        yield from panels(node["second"])

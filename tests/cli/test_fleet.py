"""``heli3dof fleet``: the important line first, one table, the page, the errors."""

from __future__ import annotations

from pathlib import Path

import pytest

from heli3dof.fleet.analyse import analyse
from heli3dof.report.text.fleet_tables import rig_table
from tests.cli.running import heli3dof
from tests.fleet.making import QUANTITIES, term_rows, write_results


@pytest.fixture(scope="module")
def term(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleet") / "term"
    write_results(folder, term_rows())
    return folder


def test_the_first_line_is_the_step_with_date_size_and_probability(term: Path) -> None:
    lines = heli3dof("fleet", term).out.splitlines()
    assert lines[0].startswith("rig-02: thrust_gain_ratio changed by −0.06")
    assert "between rig-02-13 (2026-10-21) and rig-02-14 (2026-10-26)" in lines[0]
    assert lines[0].endswith("(probability > 99.9 %).")
    assert lines[1].startswith("rig-04: friction.viscous.yaw.damping_Nms_per_rad drifted by +0.01")
    assert lines[2].startswith("rig-01: encoder.offset.roll.angle_deg deviates by +1.4")
    assert lines[3].startswith("rig-05: motor.lag.time_constant_s is 0.0")
    assert lines[4].startswith("2 of 120 recordings are not used: clock.gaps (1)")


def test_the_output_fits_one_screen(term: Path) -> None:
    assert len(heli3dof("fleet", term).out.splitlines()) < 40


def test_verbose_prints_every_quantity_and_the_bad_recordings(term: Path) -> None:
    short, long = heli3dof("fleet", term).out, heli3dof("fleet", term, "--verbose").out
    for text in ("late_share", "standard deviation between", "term/rig-03-20.mcap"):
        assert text not in short
        assert text in long


def test_json_is_one_document(term: Path) -> None:
    done = heli3dof("fleet", term, "--json")
    assert done.document["schema"] == "heli3dof.fleet/1"
    assert len(done.document["rigs"]) == 5


def test_a_single_bad_recording_is_named(tmp_path: Path) -> None:
    bad = {"rig-01-03": "{} is torn: it ends after 20 bytes.", "rig-02-05": "{} has no yaw.",
           "rig-03-07": "{} has no yaw."}  # fmt: skip
    rows = [
        {**r, "exit_code": 5, "error": bad[r["name"]].format(r["recording"])}
        if r["name"] in bad else r
        for r in term_rows() if not r["error"] and not r["faults"]
    ]  # fmt: skip
    write_results(tmp_path, rows)
    assert (
        "3 of 118 recordings are not used: exit code 5: it has no yaw (2); "
        "exit code 5: term/rig-01-03.mcap is torn: it ends after 20 bytes."
    ) in heli3dof("fleet", tmp_path).out


def test_quiet_prints_nothing(term: Path) -> None:
    done = heli3dof("fleet", term, "--quiet")
    assert (done.code, done.out, done.err) == (0, "", "")


def test_the_page_is_written_once(term: Path, tmp_path: Path) -> None:
    page = tmp_path / "term.html"
    assert heli3dof("fleet", term, "-o", page).code == 0
    assert "rig-02: thrust_gain_ratio changed by" in page.read_text(encoding="utf-8")
    again = heli3dof("fleet", term, "-o", page)
    assert (again.code, "exists" in again.err) == (2, True)


def test_flights_without_starts_are_ordered_by_name(tmp_path: Path) -> None:
    write_results(tmp_path, [{**r, "started_utc": ""} for r in term_rows()])
    out = heli3dof("fleet", tmp_path).out
    assert "between rig-02-13 and rig-02-14 (" in out
    assert "rig-01, rig-02, rig-03, rig-04, rig-05 are in the order of their names" in out


def test_one_flight_a_rig(tmp_path: Path) -> None:
    write_results(tmp_path, [r for r in term_rows() if r["name"].endswith("-00")])
    done = heli3dof("fleet", tmp_path)
    assert done.code == 0
    assert "Fewer than 8 flights, so no search for changes: rig-01, rig-02" in done.out


@pytest.mark.parametrize(
    ("change", "code", "what"),
    [(None, 2, "There is no results.csv"), ({"exit_code": 5}, 5, "None of the 120 recordings")],
)
def test_errors_have_a_cause_and_a_fix(tmp_path: Path, change, code, what) -> None:
    if change is not None:
        write_results(tmp_path, [{**r, **change} for r in term_rows()])
    done = heli3dof("fleet", tmp_path)
    assert done.code == code
    assert what in done.err
    assert "Likely cause: " in done.err
    assert "Try: heli3dof " in done.err


def test_one_rig_has_no_row_of_all_rigs(tmp_path: Path) -> None:
    write_results(tmp_path, [r for r in term_rows() if r["rig"] == "rig-01"])
    assert "all rigs" not in heli3dof("fleet", tmp_path).out


def test_the_column_of_friction_names_its_axis() -> None:
    old = "friction.viscous.yaw.damping_Nms_per_rad"
    rows = [{k.replace(old, old.replace("yaw", "pitch")): v for k, v in r.items()}
            for r in term_rows()]  # fmt: skip
    assert "pitch friction" in rig_table(analyse(rows)).columns


def test_the_table_of_batch_run_is_refused_with_the_one_that_is_needed(tmp_path: Path) -> None:
    write_results(tmp_path, [{"recording": "a.mcap", "device": "mock:", "exit_code": 0}])
    done = heli3dof("fleet", tmp_path)
    assert done.code == 5
    assert "the table of batch identify is needed" in done.err


def test_the_table_of_batch_info_is_refused_with_the_one_that_is_needed(tmp_path: Path) -> None:
    """Its only quantities describe the recordings, not the rigs."""
    rows = [{**{k: v for k, v in r.items() if k not in QUANTITIES}, "roll_start_deg": -27.5,
             "roll_start_deg_std": 0.03} for r in term_rows()]  # fmt: skip
    write_results(
        tmp_path, [{k: v for k, v in r.items() if k[:-4] not in QUANTITIES} for r in rows]
    )
    done = heli3dof("fleet", tmp_path)
    assert done.code == 5
    assert "the batch ran another verb, such as info" in done.err
    assert "Try: heli3dof batch identify" in done.err

"""Methods of every result class for notebooks."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.result import Diagnosis
from heli3dof.errors import UsageError
from heli3dof.results import Result, optional


class Four(Result):
    def summary(self) -> str:
        return "one\ntwo < three\nthree\nfour"


def test_the_repr_is_the_first_three_lines_of_the_summary_and_counts_the_others() -> None:
    assert repr(Four()) == "one\ntwo < three\nthree … (1 more in summary())"


def test_html_holds_the_whole_summary_escaped() -> None:
    assert Four()._repr_html_() == "<pre>one\ntwo &lt; three\nthree\nfour</pre>"


def test_a_class_without_a_registered_figure_is_a_usage_error() -> None:
    with pytest.raises(UsageError, match=r"heli3dof\.figures is registered for a Four"):
        Four().plot()


def test_a_missing_library_names_the_extra_that_installs_it() -> None:
    with pytest.raises(UsageError, match=r"pip install 'heli3dof\[no_such_library\]'"):
        optional("no_such_library")


def test_the_repr_of_a_diagnosis_leaves_out_no_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Diagnosis, "summary", lambda self: Four().summary())
    assert repr(Diagnosis(("a",), (), "explained", ())) == Four().summary()

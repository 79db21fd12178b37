"""Results as plain data, and the records in their folders."""

import json
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from jaxsat.store.resumable import ResumableFolder
from jaxsat.synthesis.execution import plain_data, write_record
from jaxsat.synthesis.tuning.baselines import BaselineResult
from jaxsat.synthesis.tuning.receipt import GradientCheck


class Pair(NamedTuple):
    first: float
    second: np.ndarray


@dataclass(frozen=True)
class Settings:
    cases: int
    least: float


class Result(NamedTuple):
    settings: Settings
    pairs: list[Pair]
    secret: float = 1.0

    def as_data(self):
        return {"settings": self.settings, "pairs": self.pairs, "count": len(self.pairs)}


RESULT = Result(Settings(3, np.inf), [Pair(np.nan, np.array([1.0, -np.inf]))])
PLAIN = {
    "settings": {"cases": 3, "least": None},
    "pairs": [{"first": None, "second": [1.0, None]}],
    "count": 1,
}


def test_parts_of_a_result_are_converted_with_it():
    """Dataclasses and named tuples by their fields, and others as they say."""
    assert plain_data(RESULT) == PLAIN
    assert plain_data({1.5: (np.int64(2), RESULT)}) == {"1.5": [2, PLAIN]}


def test_a_check_of_gradients_says_whether_it_is_trusted():
    one = np.ones(1)
    check = GradientCheck(one, one, one, 0.001 * one, 4, 0)
    assert plain_data(check)["trusted"]
    assert not plain_data(check._replace(error=one))["trusted"]


def test_the_evaluation_of_a_baseline_has_no_columns():
    class Evaluation(NamedTuple):
        columns: dict

        def as_data(self):
            return {"loss": np.float64(2.0)}

    result = BaselineResult("BFGS", 10.0, 2.0, True, np.ones(2), np.ones((1, 2)), Evaluation({}))
    (row,) = plain_data((result,))
    assert row["evaluation"] == {"loss": 2.0}
    assert row["point"] == [1.0, 1.0]


def test_a_record_has_command_provenance_and_schema(tmp_path):
    package = "jaxsat.synthesis.worst_case"
    with ResumableFolder(tmp_path / "r", "worst case", {}) as folder:
        record = write_record(folder, package, "worst-case", RESULT)
    written = json.loads((tmp_path / "r" / "worst-case.json").read_text())
    assert written == record
    assert PLAIN.items() <= written.items()
    assert {"command", "versions", "platform", "created"} <= set(written)
    schema = json.loads((tmp_path / "r" / "worst-case.schema.json").read_text())
    assert "command" in schema["required"]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, np.float64(np.nan)])
def test_numbers_that_are_not_finite_become_none(value):
    assert plain_data([value]) == [None]

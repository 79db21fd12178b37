"""`jaxsat compare SCENARIO`: the same failures under every law."""

import json

import numpy as np
import pytest

from jaxsat.report.document import Table
from jaxsat.report.page.batches import record_section
from jaxsat.store.labels import named_store
from jaxsat.store.tables import open_study

LAWS = ("fault-tolerant", "quaternion-feedback")
"""The scenario's own, and the other that fits its actuators."""


@pytest.mark.slow
def test_the_same_failures_strike_under_every_law(command_line, tmp_path):
    command = ["failures-12u", "--set", "simulation.duration_s=60", "--seed", "7", "-n", "4"]
    command += ["--set", "dispersion.failure_time_s={distribution='uniform', low=5, high=40}"]
    status, out, err = command_line("compare", *command, "--out", "c")
    assert status == 0, err
    studies = [open_study(named_store(tmp_path / "c", law)) for law in LAWS]
    for name in ("failure_time", "failed_part", "failure_kind", "failure_amount", "torques_left"):
        np.testing.assert_array_equal(*(one[name].values for one in studies), err_msg=name)
    assert "detection_time" in studies[0]
    assert "detection_time" not in studies[1]
    record = json.loads((tmp_path / "c" / "comparison.json").read_text())
    assert [row["law"] for row in record["rows"]] == list(LAWS)
    for row, study in zip(record["rows"], studies, strict=True):
        settled = int(np.isfinite(study["settling_time"].values).sum())
        assert row["recovered"]["all"]["recovered"] == settled
        assert row["recovered"]["all"]["cases"] == 4
    assert "quaternion-feedback: recovered" in out
    assert (tmp_path / "c" / "recovered.png").is_file()
    section = record_section(tmp_path / "c")
    laws_table, prices, recovered = (block for block in section.blocks if isinstance(block, Table))
    assert [row[0] for row in laws_table.rows] == list(LAWS)
    assert [row[0] for row in prices.rows] == list(LAWS)
    assert [row[0] for row in recovered.rows] == list(record["rows"][0]["recovered"])
    assert recovered.columns[3:] == [f"{law}: recovered" for law in LAWS]

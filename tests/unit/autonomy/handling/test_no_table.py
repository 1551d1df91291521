"""A platform on which nothing turns the plate: what needs that says so, and moves nothing."""

from pathlib import Path
from shutil import copytree
from types import SimpleNamespace
from typing import Any, cast

import pytest

import cosmic
from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation
from cosmic.frame.config import shipped_config_dir

WHY = "no axis turns the plate; name it as vico.table_axis in the platform file"


def test_no_fibre_is_taken_where_nothing_turns_the_plate(tmp_path: Path) -> None:
    config = tmp_path / "config"
    copytree(shipped_config_dir(), config)
    file = config / "platform.toml"
    text = file.read_text("utf-8").replace('table_axis = "table.rotation"', 'table_axis = ""')
    file.write_text(text, "utf-8")
    marked = cast("Any", SimpleNamespace())
    with cosmic.connect(config, rate=20.0) as rig:
        request = OperationRequest(SingleOperation.TAKE, "left", marked=marked)
        assert rig.handling.why_not(request) == WHY
        with pytest.raises(cosmic.NotAvailable, match=WHY):
            rig.vico.find_rotation_centre()
        with pytest.raises(cosmic.NotAvailable, match=WHY):
            _ = rig.handling.context("left").table

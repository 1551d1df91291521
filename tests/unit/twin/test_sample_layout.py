"""What the generator lays on the plate."""

import math

import numpy as np
import pytest

from cosmic.frame.errors import ConfigError
from cosmic.twin.force_settings import FibreSettings
from cosmic.twin.sample_layout import centre_line_um, dense, put_on
from cosmic.twin.settings import TwinSettings, shipped_settings

SHIPPED = shipped_settings()


def fibres(name: str, seed: int = 0) -> tuple[FibreSettings, ...]:
    return put_on(SHIPPED, name, seed).fibres


def changed(name: str, **values: object) -> TwinSettings:
    sample = SHIPPED.samples[name].model_copy(update=values)
    return SHIPPED.model_copy(update={"samples": {name: sample}})


def test_the_shipped_samples_are_there_and_find_room_with_any_seed() -> None:
    assert list(SHIPPED.samples) == ["three-dry", "forty-dry", "forty-wet", "crossings", "empty"]
    counts = {name: [len(fibres(name, seed)) for seed in range(3)] for name in SHIPPED.samples}
    assert counts["empty"] == [0] * 3 and counts["three-dry"] == [7] * 3
    alone = [sum(each.role == "single" for each in fibres("forty-wet", s)) for s in range(3)]
    assert alone == [40] * 3
    assert all(each.role != "single" for each in fibres("crossings"))


def test_the_seed_decides_everything() -> None:
    assert fibres("forty-dry", 4) == fibres("forty-dry", 4)
    assert fibres("forty-dry", 4) != fibres("forty-dry", 5)
    assert put_on(changed("three-dry", seed=1), "three-dry", 4).fibres != fibres("three-dry", 4)


def test_fibres_that_do_not_belong_together_lie_apart() -> None:
    sample = SHIPPED.samples["forty-dry"]
    found = fibres("forty-dry", 7)
    lines = [dense(centre_line_um(each)) for each in found]
    assert max(np.hypot(*line.T).max() for line in lines) <= sample.radius_um
    for number, (one, line) in enumerate(zip(found, lines, strict=True)):
        for other, (two, against) in enumerate(zip(found[:number], lines, strict=False)):
            nearest = np.hypot(*(line[:, None, :] - against[None, :, :]).transpose(2, 0, 1)).min()
            if one.bonded_to == other:
                assert nearest < 0.5 * (one.width_um + two.width_um) + 15.0, "they touch"
            else:
                edges = nearest - 0.5 * (one.width_um + two.width_um)
                assert edges >= sample.distance_um - 1e-2


def test_stiffness_spreads_as_the_sample_says() -> None:
    many = changed("forty-dry", single=200, crossing=0, stuck=0, debris=0, radius_um=12_000.0)
    logs = [math.log(each.ei_n_m2) for each in put_on(many, "forty-dry", 1).fibres]
    assert np.mean(logs) == pytest.approx(math.log(5e-11), abs=0.12)
    assert np.std(logs) == pytest.approx(0.55, abs=0.08)
    wet = [each.ei_n_m2 for each in fibres("forty-wet", 1)]
    assert min(wet) >= 3e-14 and np.median(wet) < 1e-11


def test_a_sample_leaves_the_grippers_open_and_empty() -> None:
    on = put_on(SHIPPED, "three-dry", 0)
    assert on.stages["left.gripper"].start == 600.0 and on.stages["right.gripper"].start == 600.0
    assert not any(each.held_by for each in on.fibres)


def test_an_unknown_sample_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ConfigError, match=r"no sample 'forty'.*three-dry, forty-dry"):
        put_on(SHIPPED, "forty", 0)


def test_a_plate_that_is_too_full_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"samples\.three-dry: no room"):
        put_on(changed("three-dry", single=300), "three-dry", 0)

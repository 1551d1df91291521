"""Worlds, the standard, and one plate after the other."""

from pathlib import Path

import numpy as np
import pytest

from cosmic.frame.clock import ManualClock
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.twin.plates import Plates
from cosmic.twin.scene import Scene
from cosmic.twin.settings import TwinSettings, shipped_settings
from cosmic.twin.truth import TruthFile, read_truth
from cosmic.twin.world import World, arc_deg, load_world, world_names
from unit.twin.force_bench import Bench

SHIPPED = ("friendly", "realistic", "harsh")


def drawn(world: World, seed: int = 0, sample: str | None = None) -> TwinSettings:
    return Plates(world.applied(shipped_settings(), seed), world, seed, sample).first()


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("seed", range(5))
def test_a_shipped_world_fits_the_twin_for_any_seed(name: str, seed: int) -> None:
    world = load_world(name, shipped_config_dir())
    settings = drawn(world, seed, "three-dry")
    assert settings.contact != shipped_settings().contact
    assert settings.fibres[-1].role == "standard"


def test_the_plain_world_is_twin_toml_as_it_stands() -> None:
    assert drawn(load_world("plain", shipped_config_dir())) == shipped_settings()
    assert set(world_names(shipped_config_dir())) == {"plain", *SHIPPED}


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no world 'kind'; known: plain, friendly"):
        load_world("kind", tmp_path)
    with pytest.raises(ConfigError, match=r"session.contact.glue: twin.toml has no such key"):
        drawn(World(session={"contact.glue": 1.0}))
    with pytest.raises(ConfigError, match="no standard 'gold'"):
        drawn(World(standard="gold"))
    (tmp_path / "worlds").mkdir()
    (tmp_path / "worlds" / "odd.toml").write_text("[fibre]\nglue = 1.0\n", "utf-8")
    with pytest.raises(ConfigError, match=r"odd.toml: .*fibre.glue: a fibre has no such key"):
        load_world("odd", tmp_path)


def test_a_number_out_of_bounds_is_refused_with_its_key() -> None:
    with pytest.raises(ConfigError, match="probe_friction"):
        drawn(World(session={"contact.probe_friction": 2.0}))


def test_one_effect_more_leaves_all_others_as_they_were() -> None:
    spread = {"lognormal": (1000.0, 0.6)}
    one = World.model_validate({"session": {"contact.jaw_side_un_um": spread}})
    two = World.model_validate(
        {"session": {"contact.probe_friction": 0.3, "contact.jaw_side_un_um": spread}}
    )
    found = [drawn(each, seed=7).contact.jaw_side_un_um for each in (one, two)]
    assert found[0] == found[1] != drawn(one, seed=8).contact.jaw_side_un_um


def test_a_star_stands_for_all_tables_of_a_kind() -> None:
    settings = drawn(World(session={"force_sensors.*.gain_error": 0.05}))
    assert {each.gain_error for each in settings.force_sensors.values()} == {0.05}


def test_spreads_are_as_wide_as_they_say() -> None:
    world = World.model_validate({"fibre": {"plane_ratio": {"lognormal": (4.0, 0.7), "low": 1.0}}})
    fibre = shipped_settings().fibres[1]
    ratios = np.log([world.fibre_of(fibre, str(n)).plane_ratio for n in range(800)])
    assert np.median(ratios) == pytest.approx(np.log(4.0), abs=0.1)
    assert ratios.std() == pytest.approx(0.65, abs=0.07)  # cut at 1


def test_an_arc_has_the_curl_index_asked_for() -> None:
    for index, known_deg in ((0.02, 39.6), (0.1, 85.8), (0.2, 117.7)):
        half = np.radians(arc_deg(index)) / 2.0
        assert half / np.sin(half) == pytest.approx(1.0 + index, rel=1e-9)
        assert arc_deg(index) == pytest.approx(known_deg, abs=0.5)


# --- the standard -----------------------------------------------------------------------------


def test_a_standard_differs_from_its_certificate_by_as_much_as_that_says() -> None:
    world = World(standard="glass")
    certificate = shipped_settings().standards["glass"]
    assert certificate.ei_n_m2 == pytest.approx(1.79e-10, rel=0.01, abs=0.0)
    off = [drawn(world, seed).fibres[-1].ei_n_m2 / certificate.ei_n_m2 - 1.0 for seed in range(400)]
    assert np.std(off) == pytest.approx(0.01, rel=0.15), "2 % with k = 2"


def test_fibres_of_a_sample_keep_clear_of_the_standard() -> None:
    settings = drawn(World(standard="glass"), sample="forty-dry")
    *others, standard = settings.fibres
    near = [
        each for each in others if abs(each.x_um) < 900.0 and abs(each.y_um - standard.y_um) < 60.0
    ]
    assert not near and len(others) > 60


# --- plates -----------------------------------------------------------------------------------


def scene(truth: TruthFile | None = None) -> Scene:
    world = World(standard="glass")
    plates = Plates(shipped_settings(), world, 3, "three-dry")
    more = {} if truth is None else {"truth": truth}
    return Scene.from_settings(
        plates.first(), ManualClock(), 3, sample="three-dry", world="own", plates=plates, **more
    )


def test_another_plate_has_other_fibres_and_the_same_standard(tmp_path: Path) -> None:
    path = tmp_path / "truth.jsonl"
    first = scene(TruthFile(path))
    assert first.force_side is not None
    before = first.force_side.timeline.moment(0.0).fibres
    assert first.change_plate() == 1
    after = first.force_side.timeline.moment(0.0).fibres
    assert len(after) == len(before) and not {e.number for e in before} & {e.number for e in after}
    assert {each.where for each in after} == {"plate"}
    assert before[-1].settings == after[-1].settings, "the standard"
    assert before[0].settings != after[0].settings
    first.close()
    truth = read_truth(path)
    assert truth.world == "own"
    assert [each.number for each in truth.fibres] == list(range(2 * len(before)))


def test_plates_are_drawn_from_the_seed() -> None:
    world = World()
    again = [Plates(shipped_settings(), world, 3, "three-dry").fibres(2) for _ in range(2)]
    assert again[0] == again[1] != Plates(shipped_settings(), world, 4, "three-dry").fibres(2)


def test_a_fibre_of_a_new_plate_can_be_taken() -> None:
    settings = shipped_settings()
    lying = settings.fibres[3].model_copy(
        update={"x_um": -1000.0, "y_um": 0.0, "angle_deg": 0.0, "curl_deg": 0.0}
    )
    one = settings.model_copy(update={"fibres": (lying,)})
    plates = Plates(one, World(), 0)
    bench = Bench()
    bench.scene = Scene.from_settings(plates.first(), ManualClock(), 0, plates=plates)
    assert bench.scene.force_side is not None
    bench.force_side = bench.scene.force_side
    bench.go(left_gripper=300.0)
    bench.scene.change_plate()
    x, y, z = bench.scene.tips(bench.now_s)["left.hold"]
    bench.go(left_x=-1300.0 - x, left_y=-y).go(left_z=5.0 - z).go(left_gripper=20.0)
    (held,) = (each for each in bench.moment.fibres if each.held_by)
    assert held.number == 1
    with pytest.raises(NotAvailable, match="put it away first"):
        bench.scene.force_side.check_plate_change(bench.now_s)


def test_a_plate_stays_while_jaws_stand_low() -> None:
    low = scene()
    assert low.force_side is not None
    stage = low.stages["left.z"]
    route = stage.route(0.0)
    route.go(-1400.0, 2000.0)
    stage.follow(route, held_until_s=1e9)
    with pytest.raises(NotAvailable, match="lift it to 300 um"):
        low.force_side.check_plate_change(2.0)


def test_a_scene_by_itself_has_no_other_plate() -> None:
    with pytest.raises(NotAvailable, match="no other plate"):
        Scene.from_settings(shipped_settings(), ManualClock()).change_plate()

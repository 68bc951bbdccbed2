"""What parts weigh: by what is annotated, by the size of their front, by their volume; as real furniture does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cabinet_rooms import clean_cabinet_room
from only_part import moving, part
from settings import load

from s2a.commands import prepare as verb
from s2a.core import config as configuration
from s2a.core.errors import InputError
from s2a.prepare.free_objects import SURFACE
from s2a.prepare.mass import MassConfig, MassRule, moving_mass
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scan.labels import family
from s2a.scene.geometry.convex import box
from s2a.scene.scene import Joint, Mesh, Part, Scene

CONFIG: MassConfig = load(PrepareConfig, "prepare/handle").mass
SLIDE = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.4))


def panel(width: float, height: float, thickness: float = 0.02, yaw: float = 0.0) -> Mesh:
    """Return an upright board whose front looks along x, turned by yaw [rad]."""
    axes = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    return box(np.zeros(3), axes, np.array([thickness, width, height]))


def hinge(width: float) -> Joint:
    return Joint("revolute", (0.0, 0.0, 1.0), (0.0, width / 2, 0.0), (0.0, 1.5))


def weigh(
    label: str, mesh: Mesh, joint: Joint = SLIDE, mass: float | None = None, config: MassConfig = CONFIG
) -> float:
    scene = Scene("one", {"part_1": Part(label, mesh, None, joint, mass=mass)})
    return moving_mass(scene, ("part_1",), config)[0]


def test_a_room_door_weighs_what_doors_do() -> None:
    # 1.6 m^2 of 12.5 kg; real ones weigh 15 to 25 kg hollow, 30 to 45 kg solid.
    assert weigh("room door", panel(0.8, 2.0), hinge(0.8)) == pytest.approx(20.0, rel=0.01)
    assert weigh("door", panel(0.6, 0.7), hinge(0.6)) == pytest.approx(5.25, rel=0.01)


@pytest.mark.parametrize("axis", [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)])
def test_a_panel_that_slides_within_its_plane_weighs_what_one_on_hinges_does(axis: tuple[float, float, float]) -> None:
    sliding = Joint("prismatic", axis, (0.0, 0.0, 0.0), (0.0, 0.4))
    for label in ("sliding door", "window", "mirror"):
        assert weigh(label, panel(0.8, 2.0), sliding) == pytest.approx(
            weigh(label, panel(0.8, 2.0), hinge(0.8)), rel=1e-3
        )


def test_a_drawer_weighs_its_front_box_and_contents() -> None:
    # Front 0.12 m^2 of 12.5 kg; bottom 0.6 x 0.4, and 0.14 m high two sides of 0.4 and a back of 0.6 m, of 8 kg; 15 kg/m^2 in it.
    boards = 0.6 * 0.4 + 0.14 * (0.4 + 0.4 + 0.6)
    expected = 0.12 * 12.5 + 8.0 * boards + 15.0 * 0.6 * 0.4
    assert weigh("drawer", panel(0.6, 0.2)) == pytest.approx(expected, rel=0.01) == pytest.approx(8.6, abs=0.1)
    far = replace(SLIDE, limits=(0.0, 50.0))  # no drawer is deeper than 0.8 m
    assert weigh("drawer", panel(0.6, 0.2), far) < 2.0 * expected


@pytest.mark.parametrize("label", ["door", "drawer", "lid", "window", "mirror", "oven door", "trash can lid"])
def test_mass_grows_with_the_front_and_does_not_depend_on_where_it_looks(label: str) -> None:
    masses = [weigh(label, panel(size, 0.5)) for size in (0.2, 0.4, 0.8)]
    assert masses == sorted(masses) and masses[2] > 1.5 * masses[0]
    turned = Joint("prismatic", (np.cos(0.7), np.sin(0.7), 0.0), (0.0, 0.0, 0.0), (0.0, 0.4))
    assert weigh(label, panel(0.4, 0.5, yaw=0.7), turned) == pytest.approx(masses[1], rel=1e-3)


def test_what_has_no_family_weighs_what_its_hull_holds_within_bounds() -> None:
    # 0.25 m cubed times 200 kg/m^3
    assert weigh("tray", panel(0.25, 0.25, 0.25)) == pytest.approx(0.25**3 * 200.0, rel=1e-5)
    assert weigh("knob", panel(0.03, 0.03, 0.03)) == CONFIG.min_estimate
    assert weigh("tray", panel(3.0, 3.0, 3.0)) == CONFIG.max_estimate


@pytest.mark.parametrize("label", ["door", "drawer", "knob", "", "trash can lid"])
@pytest.mark.parametrize("size", [(0.0, 0.0, 0.0), (0.001, 0.001, 0.001), (30.0, 30.0, 0.02)])
def test_no_part_weighs_nothing_or_no_number(label: str, size: tuple[float, float, float]) -> None:
    mesh = panel(*size) if any(size) else Mesh(np.zeros((3, 3)), [[0, 1, 2]])
    assert CONFIG.min_estimate <= weigh(label, mesh) <= CONFIG.max_estimate
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    assert weigh(label, empty) == CONFIG.min_estimate or label == "drawer"


def test_the_annotation_knows_better_and_the_longest_name_counts() -> None:
    assert weigh("kitchen drawer", panel(0.6, 0.2), mass=3.0) == 3.0
    assert CONFIG.rule("Oven_Door")[0] == "oven door" and CONFIG.rule("front door")[0] == "door"
    assert CONFIG.rule("doors") == CONFIG.rule("outdoor") == ("", CONFIG.default)
    fixed = replace(CONFIG, families={"drawer": MassRule("mass", 5.3)})
    assert weigh("drawer", panel(0.6, 0.2), config=fixed) == 5.3


def test_masses_by_label_alone_are_one_key_away() -> None:
    old: MassConfig = load(PrepareConfig, "prepare/label_mass").mass
    assert weigh("drawer", panel(0.6, 0.2), config=old) == 5.3
    assert weigh("oven door", panel(0.6, 0.4), hinge(0.6), config=old) == 4.0
    assert weigh("lid", panel(0.5, 0.5, 0.04), config=old) == pytest.approx(0.5 * 0.5 * 0.04 * 200.0, rel=1e-5)
    by_label = {name for name, rule in old.families.items() if rule.by == "mass"}
    assert by_label == {"drawer", "door", "oven door"} and all(r.by != "area" for r in old.families.values())
    free: MassConfig = load(PrepareConfig, "prepare/label_mass").free.mass
    assert (free.rule("cup")[1].value, free.rule("pillow")[1]) == (0.3, free.default)


def test_bounds_of_the_mass_that_leave_none_are_refused() -> None:
    keys = ["prepare.free.mass.min_estimate=200", "stage=a", "targets=b", "out=c"]
    with pytest.raises(InputError, match="'mass.min_estimate' is 200; expected 150 or less, as mass.max_estimate"):
        configuration.load(verb.Config, configuration.compose("prepare", keys))


@pytest.mark.slow
def test_friction_holds_a_heavy_part_on_the_slope_on_which_it_holds_a_light_one() -> None:
    settings = load(PrepareConfig, "prepare/handle")
    furniture, room = (replace(one, resolution=3000) for one in (settings.cabinet, settings.room))
    settings, scene = replace(settings, cabinet=furniture, room=room), clean_cabinet_room()
    for mass, force in ((2.0, 1.5), (7.0, 0.028 * 9.81 * 7.0), (50.0, 0.028 * 9.81 * 50.0)):
        heavy = replace(scene.parts["drawer_7"], mass=mass)
        made = prepare(replace(scene, parts={**scene.parts, "drawer_7": heavy}), "drawer_7", settings)
        assert moving(made).mass.mass == pytest.approx(mass)
        assert part(made).friction == pytest.approx(force)


@pytest.mark.parametrize(
    ("label", "size", "mass"),
    [
        ("bookcase", (0.80, 0.28, 2.02), 38.0),
        ("nightstand", (0.46, 0.35, 0.70), 15.0),
        ("dresser", (1.60, 0.48, 0.78), 72.0),
        ("office desk", (1.20, 0.60, 0.73), 25.0),
        ("dining table", (1.60, 0.90, 0.75), 32.0),
        ("kitchen chair", (0.42, 0.49, 0.90), 5.0),
        ("sofa", (2.18, 0.88, 0.88), 68.0),
        ("fridge", (0.60, 0.65, 1.85), 70.0),
        ("washing machine", (0.60, 0.60, 0.85), 70.0),
        ("microwave", (0.46, 0.36, 0.28), 12.0),
        ("tv", (1.23, 0.08, 0.71), 15.0),
        ("monitor", (0.54, 0.20, 0.42), 4.5),
        ("trash can", (0.25, 0.25, 0.35), 0.8),
        ("laundry basket", (0.45, 0.35, 0.60), 2.0),
    ],
)
def test_products_that_are_hollow_weigh_half_to_twice_what_shops_say(
    label: str, size: tuple[float, float, float], mass: float
) -> None:
    a, b, c = size
    assert mass / 2 <= SURFACE[family(SURFACE, label)] * 2 * (a * b + b * c + c * a) <= 2 * mass

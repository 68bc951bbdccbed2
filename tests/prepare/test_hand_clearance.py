"""Room for the hand: which way round it takes hold of a knob, and what of the furniture is cut free for its fingers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from cabinet_rooms import clean_cabinet_room
from only_part import cabinet
from scipy.spatial.transform import Rotation
from settings import load

from s2a.prepare.grasp import find_grasp
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.geometry.front_panel import fraction_inside
from s2a.scene.scene import Joint, Mesh, Part, Scene


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    solid = trimesh.creation.box(bounds=np.array([low, high])).subdivide().subdivide().subdivide()
    return Mesh(solid.vertices, solid.faces)


def lid_with(half_width: float, *blocks: Mesh) -> Scene:
    """Return a front at x = 0 that opens towards +x, a handle 0.03 m high before it, and what stands around."""
    slide = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.3))
    handle = box((0.02, -half_width, 0.985), (0.05, half_width, 1.015))
    parts = {
        "drawer_1": Part("drawer", box((-0.02, -0.2, 0.9), (0.0, 0.2, 1.1)), motion=slide),
        "handle_2": Part("handle", handle, parent="drawer_1", graspable=True),
    }
    parts |= {f"block_{k}": Part("block", block) for k, block in enumerate(blocks, start=3)}
    return Scene("lid", parts)


COUNTER = box((-0.2, -0.6, 0.85), (0.6, 0.6, 0.94))


def fingers_close_along(scene: Scene) -> np.ndarray:
    return Rotation.from_quat(find_grasp(scene, "drawer_1").orientation).as_matrix()[:, 1]


def test_a_knob_is_held_upright_where_there_is_room() -> None:
    assert fingers_close_along(lid_with(0.015)) == pytest.approx([0, 0, 1], abs=1e-6)


def test_a_knob_just_above_a_counter_is_held_from_the_sides() -> None:
    grasp = find_grasp(lid_with(0.016, COUNTER), "drawer_1")
    frame = Rotation.from_quat(grasp.orientation).as_matrix()
    assert abs(frame[1, 1]) == pytest.approx(1.0, abs=1e-6)
    assert frame[:, 2] == pytest.approx([-1, 0, 0], abs=1e-6)  # the approach stays
    assert grasp.size[:2] == pytest.approx((0.03, 0.032), abs=1e-3)  # along the vertical now, and across


def test_a_knob_between_counter_and_wall_is_held_askew() -> None:
    walls = [box((-0.2, side - 0.02, 0.7), (0.6, side + 0.02, 1.3)) for side in (-0.125, 0.125)]
    shelf = box((-0.2, -0.6, 1.105), (0.6, 0.6, 1.2))
    y = fingers_close_along(lid_with(0.015, *walls, shelf))
    assert abs(y[1]) == pytest.approx(np.sqrt(0.5), abs=1e-6)


def test_a_bar_is_held_across_whatever_stands_around() -> None:
    free = find_grasp(lid_with(0.08), "drawer_1")
    assert replace(find_grasp(lid_with(0.08, COUNTER), "drawer_1"), region=free.region) == free


def chest(gap: float) -> Scene:
    """Return a lid 0.04 m thick that is hinged at its back, at x = -0.5, and a level bar so far before its edge at x = 0."""
    hinge = Joint("revolute", (0.0, -1.0, 0.0), (-0.5, 0.0, 0.48), (0.0, 1.2))
    bar = box((gap, -0.15, 0.472), (gap + 0.014, 0.15, 0.488))
    parts = {
        "lid_1": Part("lid", box((-0.5, -0.4, 0.46), (0.0, 0.4, 0.5)), motion=hinge),
        "handle_2": Part("handle", bar, parent="lid_1", graspable=True),
    }
    return Scene("chest", parts)


def test_a_bar_too_near_to_its_lid_for_a_finger_between_is_taken_from_the_front() -> None:
    def approach(gap: float) -> np.ndarray:
        return Rotation.from_quat(find_grasp(chest(gap), "lid_1").orientation).as_matrix()[:, 2]

    # From above, the way on which the lid closes, an open finger would be up to 0.06 m behind the bar's middle.
    assert approach(0.025) == pytest.approx([-1, 0, 0], abs=1e-3)
    assert approach(0.1)[2] < -0.99
    grasp = find_grasp(chest(0.025), "lid_1")
    assert grasp.size[1] == pytest.approx(0.016, abs=0.002)  # between the fingers now: the bar's height


def test_furniture_that_bulges_by_millimetres_before_the_front_leaves_the_fingers_their_room() -> None:
    room = clean_cabinet_room()
    front = float(room.parts["drawer_7"].mesh.bounds[1, 0])
    point = room.grasp_point("drawer_7")
    rim = Part("rim", box((front - 0.02, -0.3, point[2] + 0.013), (front + 0.004, 0.3, point[2] + 0.05)), "cabinet_3")
    settings = load(PrepareConfig, "prepare/handle")
    furniture, around = (replace(one, resolution=3000) for one in (settings.cabinet, settings.room))
    scene = replace(room, parts={**room.parts, "rim_20": rim})
    ready = prepare(scene, "drawer_7", replace(settings, cabinet=furniture, room=around))
    low, high = [front + 0.0021, -0.009, point[2] + 0.014], [front + 0.02, 0.009, point[2] + 0.029]
    way = np.random.default_rng(0).uniform(low, high, (2000, 3))
    assert fraction_inside([collider.mesh for collider in cabinet(ready).colliders], way) == 0.0

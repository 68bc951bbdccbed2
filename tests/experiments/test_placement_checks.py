"""The checks of placements tell right from wrong on furniture whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from placement_checks import Placed, Truth, check, suits, up_and_front
from rough_furniture import at, block, sheet, table

from s2a.scene.scene import Joint, Mesh, Part, Scene

UP, FRONT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
CUP = Truth("coffee mug", 0.1, 0.1, "on")


def checked(mesh: Mesh, truth: Truth = CUP, scene: Scene | None = None, up: np.ndarray = UP) -> dict:
    longest = float(np.ptp(mesh.vertices, axis=0).max())
    return check(scene or table(), Placed(mesh, up, FRONT, longest), truth)


def cup(x: float = 0.8, y: float = 0.3, z: float = 0.743) -> Mesh:
    return at(block(0.08, 0.08, 0.1), x, y, z)


def test_a_mug_on_the_table_is_right() -> None:
    found = checked(cup())
    assert found["right"]
    assert found["support"] == "table_2"


@pytest.mark.parametrize(
    ("mesh", "check"),
    [
        (cup(z=0.80), "carried"),  # 6 cm above the table
        (cup(z=0.72), "free"),  # 2 cm in it
        (cup(x=0.25), "free"),  # in the crate
        (cup(x=1.20), "inside_support"),  # half of it beyond the edge
        (cup(x=2.0, z=0.001), "suits"),  # on the floor
        (at(block(0.2, 0.2, 0.25), 0.8, 0.3, 0.743), "size"),
    ],
)
def test_each_fault_is_found(mesh: Mesh, check: str) -> None:
    found = checked(mesh)
    assert not found["right"]
    assert not found[check]


def test_upside_down_is_found() -> None:
    assert not checked(cup(), up=-UP)["upright"]


def test_a_drawer_that_would_meet_it_is_found() -> None:
    parts = dict(table().parts)
    front = at(block(0.4, 0.02, 0.15), 0.8, 0.02, 0.75)
    slide = Joint("prismatic", (0.0, 1.0, 0.0), (0.8, 0.0, 0.75), (0.0, 0.4))
    scene = Scene("room", {**parts, "drawer_9": Part("drawer", front, "table_2", slide)})
    assert checked(cup(), scene=scene)["blocks"] == ["drawer_9"]


@pytest.mark.parametrize("gap", [0.005, 0.3])
def test_what_hangs_has_a_wall_behind_it(gap: float) -> None:
    flat = sheet((-2, 2), (0, 2.5), 0.0, 0.05)
    wall = Mesh(flat.vertices[:, [2, 0, 1]], flat.faces)  # the plane x = 0
    scene = Scene("room", {"wall_1": Part("wall", wall)})
    picture = at(block(0.02, 0.6, 0.4), gap + 0.01, 0.0, 1.5)
    found = checked(picture, Truth("painting", 0.6, 0.4, "hanging"), scene)
    assert found["right"] == (gap < 0.01)


def test_axes_of_a_file_are_followed_into_the_scene() -> None:
    # The plan took +y for up and +z for the front: the own frame has them along z and x. Turned by 90 degrees about z.
    half = np.sqrt(0.5)
    up, front = up_and_front({"up": "+y", "front": "+z"}, "+y", "+x", (0.0, 0.0, half, half))
    assert up == pytest.approx([0, 0, 1])
    # +x of the file is +y of the own frame (z x x = y), which turns to -x.
    assert front == pytest.approx([-1, 0, 0])


def test_words_are_whole_words() -> None:
    assert suits(CUP, "storage cabinet")  # no bin
    assert not suits(CUP, "pedal bin")
    assert suits(CUP, "tv stand")
    assert not suits(CUP, "tv")
    assert suits(Truth("cooking pot", None, None, "on"), "stove")
    assert not suits(CUP, "stove")

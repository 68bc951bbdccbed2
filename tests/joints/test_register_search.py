"""What registration asks of a front that could have opened: is its old place empty, and is it no floor."""

from __future__ import annotations

import numpy as np
import pytest
from box_room import joined, sheet

from s2a.joints.register_fit import MIN_FRACTION, starts
from s2a.joints.register_search import MIN_GONE, MIN_INSIDE, gone, left, on_floor, shows_inside
from s2a.joints.register_surface import OrientedMesh, Patch, changed, patches
from s2a.scene.articulation import transform
from s2a.scene.scene import Joint, Mesh

DRAWER = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.1))
"""Opens by 10 cm along x."""


def upright(x: float, y: tuple[float, float], z: tuple[float, float], edge: float = 0.02) -> Mesh:
    """Return a sheet across x that faces along +x."""
    found = sheet((x, y[0], z[0]), (0, y[1] - y[0], 0), (0, 0, z[1] - z[0]), edge)
    assert OrientedMesh(found.vertices.astype(float), found.faces).normals[:, 0].min() > 0.99
    return found


def surface(*meshes: Mesh) -> OrientedMesh:
    whole = joined(*meshes)
    return OrientedMesh(whole.vertices.astype(np.float64), whole.faces)


def patch_of(mesh: OrientedMesh) -> Patch:
    [found] = patches(changed(mesh, np.ones(len(mesh.faces), bool)))
    return found


FRONT = upright(0.0, (0.0, 0.45), (0.3, 0.6))
AHEAD = upright(0.1, (0.0, 0.45), (0.3, 0.6))
"""The front where it stands open: nothing of its back is seen."""
INSIDE = upright(-0.4, (0.0, 0.45), (0.3, 0.6))


def test_a_front_that_hides_its_old_place_itself_has_left_it_where_the_inside_is_seen() -> None:
    closed, opened = surface(FRONT), surface(AHEAD, INSIDE)
    patch = patch_of(closed)
    assert gone(patch, opened) < MIN_GONE, "most lines to the old place meet the open front from behind"
    assert gone(patch, opened, DRAWER) == 1.0, "those that do not meet it are free"
    assert shows_inside(patch, opened) > 0.9 > MIN_INSIDE
    assert left(DRAWER, patch, opened)


def test_a_wall_behind_a_box_that_was_put_before_it_has_not_moved() -> None:
    closed, opened = surface(FRONT), surface(AHEAD)
    patch = patch_of(closed)
    assert shows_inside(patch, opened) == 0.0
    assert not left(DRAWER, patch, opened)


def test_what_something_else_hides_has_not_left_its_place() -> None:
    """A cupboard stands 5 cm before the front; what the joint says is farther away."""
    opened = surface(upright(0.05, (-0.5, 0.95), (0.0, 1.2)), INSIDE, upright(0.3, (0.0, 0.45), (0.3, 0.6)))
    far = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.3))
    patch = patch_of(surface(FRONT))
    assert gone(patch, opened, far) < MIN_GONE
    assert not left(far, patch, opened)


@pytest.mark.parametrize(("height", "floor"), [(0.0, True), (0.01, True), (0.7, False)])
def test_floor_is_no_front_but_a_lid_is(height: float, floor: bool) -> None:
    room = surface(sheet((0, 0, 0), (3, 0, 0), (0, 3, 0), 0.1), sheet((3, 0, 0.7), (1, 0, 0), (0, 3, 0), 0.1))
    patch = patch_of(surface(sheet((1, 1, height), (0.4, 0, 0), (0, 0.5, 0), 0.02)))
    assert on_floor(patch, room) == floor


def test_a_wall_is_no_floor() -> None:
    room = surface(sheet((0, 0, 0), (3, 0, 0), (0, 3, 0), 0.1))
    assert not on_floor(patch_of(surface(upright(0.0, (0.0, 1.0), (0.0, 0.5)))), room)


def test_a_small_drawer_is_found_though_its_front_is_a_tenth_of_a_patch_with_a_door() -> None:
    """Door and drawer of one plane are one patch of 0.33 m^2; the drawer's 0.03 m^2 is 0.1 m before it afterwards."""
    closed = surface(upright(0.0, (0.0, 0.3), (0.0, 1.0)), upright(0.0, (0.3, 0.45), (0.8, 1.0)))
    opened = surface(upright(0.1, (0.3, 0.45), (0.8, 1.0)))
    whole, slid = patch_of(closed), patch_of(opened)
    assert slid.area / whole.area < MIN_FRACTION
    [found] = starts([whole], [slid], opened)
    np.testing.assert_allclose(transform(found.joint, found.q)[:3, 3], (0.1, 0.0, 0.0), atol=1e-3)

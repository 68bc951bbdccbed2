"""Spheres cover the links of a robot; what they reach into is found, itself included."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from s2a import robot
from s2a.robot.collision import BULGE, FINGER_BULGE, covering, hulls, robot_shape


@pytest.mark.parametrize("name", robot.names())
def test_the_spheres_cover_the_links_and_little_more(name: str) -> None:
    spec = robot.load(name)
    shape = robot_shape(spec)
    poses, q = shape.kin.frames(np.array([spec.home]))[0], np.array([spec.home])
    centers = shape.centers(q)[0]
    for link, solids in hulls(spec).items():
        pose = poses[shape.kin.links.index(link)]
        for solid in solids:
            points = trimesh.transform_points(solid.sample(1000, seed=0), pose)
            gap = (np.linalg.norm(points[:, None] - centers[None], axis=2) - shape.radii).min(axis=1)
            assert gap.max() < 0.01
    bulge = np.where(shape.fingers, FINGER_BULGE, BULGE)
    assert _outwards(spec, shape, poses, centers).max() < 0.002 + bulge.max()


def test_spheres_cover_a_thin_slanted_rod() -> None:
    # of random points in its bounds nearly none lie in it
    rod = trimesh.creation.cylinder(0.005, 0.6, transform=trimesh.transformations.euler_matrix(0.7, 0.6, 0.0))
    *centers, radii = np.array(covering(rod.convex_hull, BULGE)).T
    points = rod.sample(1000, seed=1)
    bare = (np.linalg.norm(points[:, None] - np.stack(centers, axis=1), axis=2) > radii).all(axis=1)
    assert bare.mean() < 0.02 and radii.max() <= 0.005 + BULGE


def _outwards(spec, shape, poses, centers):
    """Return how far each sphere stands out of the hull from which it does least [m]."""
    best = np.full(len(centers), np.inf)
    for link, solids in hulls(spec).items():
        local = trimesh.transform_points(centers, np.linalg.inv(poses[shape.kin.links.index(link)]))
        for solid in solids:
            planes = ConvexHull(solid.vertices).equations
            best = np.minimum(best, (local @ planes[:, :3].T + planes[:, 3]).max(axis=1) + shape.radii)
    return best


def test_a_folded_arm_collides_with_itself_and_the_home_pose_does_not() -> None:
    shape = robot_shape(robot.load("panda"))
    home = np.array(shape.kin.spec.home)
    assert shape.self_penetration(home[None]) == (0.0, "")
    # The elbow folded fully over a bent shoulder presses the gripper, 0.09 m behind the axis at 0.19 m, on the foot.
    folded = np.array([0.0, 0.5, 0.0, -3.07, 0.0, 1.6, 0.785])
    depth, words = shape.self_penetration(np.stack([home, folded]))
    assert depth > 0.02 and words == "itself (panda_link0 and panda_link7)"


def test_the_gripper_of_the_panda_fits_into_its_boxes() -> None:
    spec = robot.load("panda")
    shape, gripper = robot_shape(spec), spec.gripper
    ends = shape.gripper[:, 2] + shape.gripper_radii
    assert ends.max() == pytest.approx(gripper.tip_ahead, abs=FINGER_BULGE + 0.002)
    widths = np.abs(shape.gripper[:, 1]) + shape.gripper_radii
    assert widths.max() == pytest.approx(gripper.body_box[1] / 2, abs=BULGE + 0.002)

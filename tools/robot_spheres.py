"""Write s2a/robot/<name>/spheres.csv: spheres around the surfaces of the convex hulls of a robot's collision geometry.

python tools/robot_spheres.py panda
"""

from __future__ import annotations

import argparse
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from s2a import robot
from s2a.robot import urdf
from s2a.robot.spec import RobotSpec

BULGE = 0.02
"""[m] How far a sphere may stand out of a hull."""
FINGER_BULGE = 0.01
"""[m] Likewise out of a finger's, whose room is small."""


def cover(solid: trimesh.Trimesh, bulge: float) -> list[tuple[np.ndarray, float]]:
    """Return few spheres that cover the surface of a convex solid and stand out of it by `bulge` [m] at most.

    Of all spheres around inner points, the one that covers most of what is still bare is taken, until nothing is.
    """
    surface = np.concatenate([solid.sample(4000, seed=0), solid.vertices])
    inner = np.random.default_rng(0).uniform(*solid.bounds, (20000, 3))
    planes = ConvexHull(solid.vertices).equations
    depth = -(inner @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    inner, radius = inner[depth > 0.0][:6000], depth[depth > 0.0][:6000] + bulge
    covers = np.linalg.norm(inner[:, None] - surface[None], axis=2) < radius[:, None]
    bare, spheres = np.ones(len(surface), bool), []
    while bare.sum() > 0.01 * len(surface):
        best = int(np.argmax(covers @ bare))
        bare &= ~covers[best]
        spheres.append((inner[best], float(radius[best])))
    return spheres


def hulls(spec: RobotSpec) -> dict[str, list[trimesh.Trimesh]]:
    """Return the convex hulls of every link's collision shapes in the link's frame, a finger's as one."""
    found = {}
    for link in urdf.arm(spec).findall("link"):
        name, solids = str(link.get("name")), [_solid(shape) for shape in link.findall("collision")]
        if name in spec.gripper.links:
            solids = [trimesh.util.concatenate(solids)]
        found[name] = [solid.convex_hull for solid in solids]
    return found


def _solid(collision: ElementTree.Element) -> trimesh.Trimesh:
    """Return a collision shape of a URDF in its link's frame."""
    geometry = collision.find("geometry")
    assert geometry is not None
    (shape,) = geometry
    if shape.tag == "mesh":
        path = urdf.description_folder() / str(shape.get("filename")).removeprefix("package://")
        solid = trimesh.load(str(path), force="mesh")
        solid.apply_scale([float(x) for x in shape.get("scale", "1 1 1").split()])
    elif shape.tag == "box":
        solid = trimesh.creation.box([float(x) for x in str(shape.get("size")).split()])
    elif shape.tag == "cylinder":
        solid = trimesh.creation.cylinder(float(shape.get("radius", 0)), float(shape.get("length", 0)))
    else:
        solid = trimesh.creation.icosphere(radius=float(shape.get("radius", 0)))
    return solid.apply_transform(urdf.origin(collision))


def main(name: str) -> None:
    """Write the table: link, center and radius [m]."""
    spec, lines = robot.load(name), ["link,x,y,z,radius"]
    for link, solids in hulls(spec).items():
        bulge = FINGER_BULGE if link in spec.gripper.links else BULGE
        balls = [ball for solid in solids for ball in cover(solid, bulge)]
        lines += [f"{link},{x:.3f},{y:.3f},{z:.3f},{radius:.3f}" for (x, y, z), radius in balls]
    path = Path(robot.__file__).parent / name / "spheres.csv"
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join([*lines, ""]))
    print(f"{path}: {len(lines) - 1} spheres")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=robot.names())
    main(parser.parse_args().name)

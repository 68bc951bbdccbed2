"""Write s2a/prepare/panda_spheres.csv: balls around the surfaces of the convex hulls of the Panda's collision meshes.

python tools/panda_spheres.py
"""

from __future__ import annotations

from importlib.metadata import files
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

LINKS = (*(f"link{i}" for i in range(1, 8)), "hand")
OUTWARDS = 0.02
"""[m] How far a ball may stand out of a hull."""
TOOL = 0.1034
"""[m] The tool's frame before the hand's."""
FINGERS = [(7, 0.0, y, z, 0.018) for y in (0.055, -0.055) for z in (-0.032, -0.010)]
"""Of the open fingers, whose colliders are boxes in the URDF."""


def cover(solid: trimesh.Trimesh) -> list[tuple[np.ndarray, float]]:
    """Return few balls that cover the surface of a convex solid and stand out of it by OUTWARDS at most.

    Of all balls around inner points, the one that covers most of what is still bare is taken, until nothing is.
    """
    surface = np.concatenate([solid.sample(4000, seed=0), solid.vertices])
    inner = np.random.default_rng(0).uniform(*solid.bounds, (20000, 3))
    planes = ConvexHull(solid.vertices).equations
    depth = -(inner @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    inner, radius = inner[depth > 0.0][:6000], depth[depth > 0.0][:6000] + OUTWARDS
    covers = np.linalg.norm(inner[:, None] - surface[None], axis=2) < radius[:, None]
    bare, balls = np.ones(len(surface), bool), []
    while bare.sum() > 0.01 * len(surface):
        best = int(np.argmax(covers @ bare))
        bare &= ~covers[best]
        balls.append((inner[best], float(radius[best])))
    return balls


def main() -> None:
    """Write the table: frame (0 to 6: links 1 to 7, 7: the tool), x, y, z, radius [m]."""
    rows = []
    for frame, link in enumerate(LINKS):
        name = f"panda_description/meshes/collision/{link}.stl"
        path = next(f.locate() for f in files("example-robot-data") or [] if name in str(f))
        solid = trimesh.load(str(path)).convex_hull
        shift = np.array([0.0, 0.0, TOOL if link == "hand" else 0.0])
        rows += [(frame, *(center - shift), radius) for center, radius in cover(solid)]
    lines = [f"{frame},{x:.3f},{y:.3f},{z:.3f},{radius:.3f}" for frame, x, y, z, radius in [*rows, *FINGERS]]
    path = Path(__file__).parent.parent / "s2a" / "prepare" / "panda_spheres.csv"
    path.write_text("\n".join(["frame,x,y,z,radius", *lines, ""]))


if __name__ == "__main__":
    main()

"""What the surfaces of a sim.usd must be: finite, convex where they collide, few; and the grasp where it was annotated."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from s2a.certify.check import Check, check_bound, decide
from s2a.certify.contents import Contents, faces, points
from s2a.core.ranges import CountFromZero, NotNegative
from s2a.scene.usd.sim_scene import PREPARE_AGAIN
from s2a.scene.usd.stage import ROOT, read_attribute

DEEPEST = 0.03
"""[m] How far the region of a recessed pull may lie behind its grasp site, which is where a tool frame is: behind fingertips."""
OPEN = 0.02
"""Fraction of its hull's volume that a collider may lack: more is a hole or a dent."""


@dataclass(frozen=True)
class ShapeConfig:
    """Bounds of the static rules about surfaces.

    Attributes:
        dent: how far a point or face of a collider may lie inside of its convex hull [m].
        target_hulls: most colliders of the part.
        site: how far the grasp site may lie from the middle of the grasp region [m].
        recess_site: the same of a recessed pull, across the approach [m].
    """

    dent: NotNegative
    target_hulls: CountFromZero
    site: NotNegative
    recess_site: NotNegative


def finite(contents: Contents, config: ShapeConfig) -> Check:
    """Every coordinate of every surface is a number."""
    bad = [(str(prim.GetPath()), int((~np.isfinite(points(prim))).any(axis=1).sum())) for prim in contents.meshes]
    problems = [(path, f"{count} points are not finite") for path, count in bad if count]
    return decide("finite", problems, "correct the scan's points and export it again", f"{len(bad)} surfaces")


def collision(contents: Contents, config: ShapeConfig) -> Check:
    """Every mesh in a folder of colliders collides, as a convex hull, and names the part it approximates."""
    problems = []
    for prim in contents.colliders:
        path, mesh = str(prim.GetPath()), UsdPhysics.MeshCollisionAPI(prim)
        if not prim.HasAPI(UsdPhysics.CollisionAPI):
            problems.append((path, "no PhysicsCollisionAPI: a simulator passes through it"))
        elif UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get() is False:
            problems.append((path, "its collision is switched off"))
        approximation = mesh.GetApproximationAttr().Get() if prim.HasAPI(UsdPhysics.MeshCollisionAPI) else None
        if approximation != UsdPhysics.Tokens.convexHull:
            problems.append((path, f"its approximation is {approximation}, not convexHull"))
        if not prim.GetAttribute("s2a:part").Get():
            problems.append((path, "no s2a:part names the part it approximates"))
    return decide("collision", problems, PREPARE_AGAIN, f"{len(contents.colliders)} colliders")


def convex(contents: Contents, config: ShapeConfig) -> Check:
    """Every collider is a closed convex surface; MuJoCo would silently fill what is not."""
    worst, where, message = 0.0, "", f"{len(contents.colliders)} colliders against their convex hulls"
    for prim in contents.colliders:
        depth = dent(points(prim), faces(prim))
        if not depth <= worst:
            worst, where = depth, str(prim.GetPath())
    remedy = "decompose the collider into convex hulls; " + PREPARE_AGAIN
    return check_bound("convex", worst, config.dent, "m", prim=where, message=message, remedy=remedy)


def dent(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Return how far a surface's points and face centres reach into its convex hull [m]; inf if it is flat or not closed.

    Args:
        vertices: shape [vertex 3].
        triangles: shape [face 3].
    """
    if len(triangles) < 4 or not np.isfinite(vertices).all():
        return math.inf
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        return math.inf
    asked = np.concatenate([vertices, vertices[triangles].mean(axis=1)])
    depth = -(asked @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    volume = abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0
    return float(max(0.0, depth.max())) if volume > (1.0 - OPEN) * hull.volume else math.inf


def collider_count(contents: Contents, config: ShapeConfig) -> Check:
    """The part has colliders, and there are no more than a simulator handles by the thousand."""
    room = contents.stage.GetPrimAtPath(f"{ROOT}/static")
    own = len(contents.colliders_of(contents.target)) if contents.target else 0
    problems = []
    if not 1 <= own <= config.target_hulls:
        text = f"{own} colliders on the part, possible: 1 to {config.target_hulls}"
        problems.append((f"{ROOT}/{contents.part}", text))
    around = len(contents.colliders_of(room)) if room else 0
    return decide(
        "collider_count",
        problems,
        PREPARE_AGAIN,
        f"{own} on the part; {around} in the room, of which a world loads some",
    )


def grasp_and_base(contents: Contents, config: ShapeConfig) -> Check:
    """The stage has a grasp site, a grasp region and a base pose for the target."""
    name = "grasp_and_base"
    if contents.target is None:
        return Check(name, "skipped", message="requires check target")
    grasp, region = (contents.target.GetChild(key) for key in ("grasp", "region"))
    problems = []
    if not grasp or not isinstance(grasp.GetAttribute("s2a:size").Get(), Gf.Vec3d):
        problems.append((f"{contents.target.GetPath()}/grasp", "no grasp site with s2a:size, three doubles"))
    if not region or not len(faces(region)):
        problems.append((f"{contents.target.GetPath()}/region", "no annotated grasp region"))
    bases = contents.target.GetChild("bases")
    if not bases or not bases.GetChildren():
        problems.append((str(contents.target.GetPath()), "no base pose"))
    for base in bases.GetChildren() if bases else []:
        ops = {op.GetOpName() for op in UsdGeom.Xformable(base).GetOrderedXformOps()}
        if not {"xformOp:translate", "xformOp:orient"} <= ops:
            problems.append((str(base.GetPath()), "the base pose lacks a translation or an orientation"))
    return decide(name, problems, PREPARE_AGAIN, prim=f"{contents.target.GetPath()}/grasp")


def grasp_site(contents: Contents, config: ShapeConfig) -> Check:
    """The grasp site is the mean of the annotated grasp region; of a recessed pull before its middle, seen along the approach."""
    name = "grasp_site"
    site, region = (contents.target and contents.target.GetChild(key) for key in ("grasp", "region"))
    if not site or not region or not len(faces(region)):
        return Check(name, "skipped", message="requires check grasp_and_base")
    place = UsdGeom.Xformable(site).ComputeLocalToWorldTransform(Usd.TimeCode.Default()).ExtractTranslation()
    a, b, c = np.moveaxis(points(region)[faces(region)], 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    away, limit = np.average((a + b + c) / 3.0, axis=0, weights=areas) - np.array(Gf.Vec3d(place)), config.site
    if read_attribute(site, "internal", bool, False):
        turn = UsdGeom.Xformable(site).ComputeLocalToWorldTransform(Usd.TimeCode.Default()).ExtractRotationQuat()
        away = Rotation.from_quat([*turn.GetImaginary(), turn.GetReal()]).inv().apply(away)
        away, limit = away * ([1, 1, 0] if 0.0 <= away[2] <= DEEPEST else [1, 1, 1]), config.recess_site
    return check_bound(
        name, float(np.linalg.norm(away)), limit, "m", prim=str(site.GetPath()),
        message="from the middle of the grasp region", remedy="put the site where the region is; " + PREPARE_AGAIN,
    )  # fmt: skip


ROOM_RULES: tuple[Callable[[Contents, ShapeConfig], Check], ...] = (finite, collision, convex)
"""Rules about all surfaces of the room."""
PART_RULES: tuple[Callable[[Contents, ShapeConfig], Check], ...] = (collider_count, grasp_and_base, grasp_site)
"""Rules about the surfaces of one articulated part."""

"""Contents of a sim.usd, read without trusting it, and the rules for its surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from s2a.core.bounds import CountFromZero, NotNegative
from s2a.core.check import Check, at_most, no_problems
from s2a.core.errors import InputError
from s2a.scene.usd.joints import joint_ends
from s2a.scene.usd.sim_scene import PREPARE_AGAIN
from s2a.scene.usd.sim_stage import FLAVOUR
from s2a.scene.usd.stage import ROOT, read_attribute, reading


@dataclass(frozen=True)
class Contents:
    """The prims that the rules ask.

    Attributes:
        stage: the open stage.
        part: id of the articulated part that is asked about; empty if the stage has none.
        target: the prim of that name, or None.
        joint: the one joint that moves it, or None if there is none or several.
        carrier: the body that it moves against, or None.
        bodies: all rigid bodies.
        joints: all joints.
        meshes: everything with points.
    """

    stage: Usd.Stage
    part: str
    target: Usd.Prim | None
    joint: Usd.Prim | None
    carrier: Usd.Prim | None
    bodies: tuple[Usd.Prim, ...]
    joints: tuple[Usd.Prim, ...]
    meshes: tuple[Usd.Prim, ...]

    @property
    def colliders(self) -> tuple[Usd.Prim, ...]:
        """Everything that collides or lies in a folder of colliders."""
        return tuple(
            p for p in self.meshes if p.HasAPI(UsdPhysics.CollisionAPI) or p.GetParent().GetName() == "colliders"
        )

    def colliders_of(self, body: Usd.Prim) -> tuple[Usd.Prim, ...]:
        """Return the colliders below a prim."""
        return tuple(p for p in self.colliders if p.GetPath().HasPrefix(body.GetPath()))


def read(path: Path, part: str | None = None) -> Contents:
    """Open a sim.usd, as it is on disk now.

    Args:
        path: the file.
        part: id of the articulated part to ask about; None: the first one.

    Raises:
        InputError: no such file, not USD, a stage of another flavour, or no such part.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; give a sim.usd, which s2a prepare writes")
    with reading(path):
        stage = Usd.Stage.Open(str(path))
        stage.Reload()
    root = stage.GetPrimAtPath(ROOT)
    if not root or root.GetAttribute("s2a:flavour").Get() != FLAVOUR:
        raise InputError(f"{path}: not a simulation-ready stage (no s2a:flavour {FLAVOUR!r}); run s2a prepare")
    prims = tuple(stage.Traverse(Usd.TraverseInstanceProxies()))
    held = Contents(
        stage=stage,
        part="",
        target=None,
        joint=None,
        carrier=None,
        bodies=tuple(prim for prim in prims if prim.HasAPI(UsdPhysics.RigidBodyAPI)),
        joints=tuple(prim for prim in prims if prim.IsA(UsdPhysics.Joint)),
        meshes=tuple(prim for prim in prims if prim.IsA(UsdGeom.PointBased)),
    )
    known = parts(held)
    if part is not None and part not in known:
        raise InputError(f"part {part!r} is no articulated part of {path}; possible: {', '.join(known) or 'none'}")
    return about(held, part or next(iter(known), ""))


def parts(held: Contents) -> tuple[str, ...]:
    """Return the ids of all articulated parts: the joints that are not fixed are called like them."""
    return tuple(prim.GetName() for prim in held.joints if not prim.IsA(UsdPhysics.FixedJoint))


def about(held: Contents, part: str) -> Contents:
    """Return the same contents, asked about another part."""
    target = held.stage.GetPrimAtPath(f"{ROOT}/{part or '_'}")
    moving = [prim for prim in held.joints if target and target.GetPath() in ends(prim)[1]]
    joint = moving[0] if len(moving) == 1 else None
    carriers = [held.stage.GetPrimAtPath(path) for path in ends(joint)[0]] if joint else []
    carrier = carriers[0] if len(carriers) == 1 and carriers[0] else None
    return replace(held, part=part, target=target or None, joint=joint, carrier=carrier)


def fixed_carrier(held: Contents) -> Usd.Prim | None:
    """Return the last of the bodies that carry the part, one the other; None if a joint among them has no body to hang on."""
    body, seen = held.carrier, set()
    while body and body.GetPath() not in seen:
        seen.add(body.GetPath())
        above = [j for j in held.joints if ends(j)[1] == [body.GetPath()] and ends(j)[0]]
        if not above:
            return body
        body = held.stage.GetPrimAtPath(ends(above[0])[0][0])
    return None


def ends(joint: Usd.Prim) -> tuple[list[str], list[str]]:
    """Return the paths of what a joint holds on to, and of what it moves."""
    return joint_ends(joint)


def points(prim: Usd.Prim) -> np.ndarray:
    """Return a mesh's points in the scene [m], shape [point 3], float64."""
    values = np.asarray(UsdGeom.PointBased(prim).GetPointsAttr().Get() or [], np.float64).reshape(-1, 3)
    matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    return values @ matrix[:3, :3] + matrix[3, :3]


def faces(prim: Usd.Prim) -> np.ndarray:
    """Return a mesh's triangles, shape [face 3]; none if it has other faces, or indices that fit no point."""
    mesh = UsdGeom.Mesh(prim)
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get() or [], int)
    indices = np.asarray(mesh.GetFaceVertexIndicesAttr().Get() or [], int)
    size = len(mesh.GetPointsAttr().Get() or [])
    if (counts != 3).any() or len(indices) != 3 * len(counts) or (len(indices) and not 0 <= indices.max() < size):
        return np.zeros((0, 3), int)
    return indices.reshape(-1, 3)


DEEPEST = 0.03
"""[m] How far the region of a recessed pull may lie behind its grasp site, which is where a tool frame is: behind fingertips."""
OPEN = 0.02
"""Fraction of its hull's volume that a collider may lack: more is a hole or a dent."""


@dataclass(frozen=True)
class ShapeConfig:
    """Bounds of the static rules about surfaces.

    Attributes:
        dent: how far a point or face of a collider may lie inside of its convex hull [m]. Float32 points of a fraction
            of a metre are exact to 1e-7.
        target_hulls: most colliders of the part.
        site: how far the grasp site may lie from the middle of the grasp region [m].
        recess_site: the same of a recessed pull, across the approach [m]. A scanner sees little of the upper wall, so
            that the mean of what it saw was off by 1 to 4 mm in three.
    """

    dent: NotNegative = 0.0001
    target_hulls: CountFromZero = 32
    site: NotNegative = 0.001
    recess_site: NotNegative = 0.008


def finite(contents: Contents, config: ShapeConfig) -> Check:
    """Every coordinate of every surface is a number."""
    bad = [(str(prim.GetPath()), int((~np.isfinite(points(prim))).any(axis=1).sum())) for prim in contents.meshes]
    problems = [(path, f"{count} points are not finite") for path, count in bad if count]
    return no_problems("finite", problems, "correct the scan's points and export it again", f"{len(bad)} surfaces")


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
    return no_problems("collision", problems, PREPARE_AGAIN, f"{len(contents.colliders)} colliders")


def convex(contents: Contents, config: ShapeConfig) -> Check:
    """Every collider is a closed convex surface; MuJoCo would silently fill what is not."""
    worst, where, message = 0.0, "", f"{len(contents.colliders)} colliders against their convex hulls"
    for prim in contents.colliders:
        depth = dent(points(prim), faces(prim))
        if not depth <= worst:
            worst, where = depth, str(prim.GetPath())
    remedy = "decompose the collider into convex hulls; " + PREPARE_AGAIN
    return at_most("convex", worst, config.dent, "m", prim=where, message=message, remedy=remedy)


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
    return no_problems(
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
    return no_problems(name, problems, PREPARE_AGAIN, prim=f"{contents.target.GetPath()}/grasp")


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
    return at_most(
        name, float(np.linalg.norm(away)), limit, "m", prim=str(site.GetPath()),
        message="from the middle of the grasp region", remedy="put the site where the region is; " + PREPARE_AGAIN,
    )  # fmt: skip


ROOM_RULES: tuple[Callable[[Contents, ShapeConfig], Check], ...] = (finite, collision, convex)
"""Rules about all surfaces of the room."""
PART_RULES: tuple[Callable[[Contents, ShapeConfig], Check], ...] = (collider_count, grasp_and_base, grasp_site)
"""Rules about the surfaces of one articulated part."""

"""Contents of a sim.usd, read without trusting it."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics

from s2a.core.bounds import CountFromZero, NotNegative
from s2a.core.check import Suite
from s2a.core.errors import InputError
from s2a.scene.usd.joints import is_body, joint_ends
from s2a.scene.usd.sim_read import require_flavour
from s2a.scene.usd.stage import ROOT, reading


@dataclass(frozen=True)
class Contents:
    """The prims that the rules ask."""

    stage: Usd.Stage  # the open stage
    part: str  # id of the articulated part that is asked about; empty if the stage has none
    target: Usd.Prim | None  # the prim of that name, or None
    joint: Usd.Prim | None  # the one joint that moves it, or None if there is none or several
    carrier: Usd.Prim | None  # the body that it moves against, or None
    bodies: tuple[Usd.Prim, ...]  # all rigid bodies
    joints: tuple[Usd.Prim, ...]  # all joints
    meshes: tuple[Usd.Prim, ...]  # everything with points

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

    `part`: id of the articulated part to ask about; None: the first one.

    Raises:
        InputError: no such file, not USD, a stage of another flavour, or no such part.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; give a sim.usd, which s2a prepare writes")
    with reading(path):
        stage = Usd.Stage.Open(str(path))
        stage.Reload()
    require_flavour(stage.GetPrimAtPath(ROOT), path)
    prims = tuple(stage.Traverse(Usd.TraverseInstanceProxies()))
    held = Contents(
        stage=stage,
        part="",
        target=None,
        joint=None,
        carrier=None,
        bodies=tuple(prim for prim in prims if is_body(prim)),
        joints=tuple(prim for prim in prims if prim.IsA(UsdPhysics.Joint)),
        meshes=tuple(prim for prim in prims if prim.IsA(UsdGeom.PointBased)),
    )
    names = parts(held)
    if part is not None and part not in names:
        raise InputError(f"part {part!r} is no articulated part of {path}; possible: {', '.join(names) or 'none'}")
    return about(held, part or next(iter(names), ""))


def parts(held: Contents) -> tuple[str, ...]:
    """Return the ids of all articulated parts: the joints that are not fixed are called like them."""
    return tuple(prim.GetName() for prim in held.joints if not prim.IsA(UsdPhysics.FixedJoint))


def about(held: Contents, part: str) -> Contents:
    """Return the same contents, asked about another part."""
    target = held.stage.GetPrimAtPath(f"{ROOT}/{part or '_'}")
    moving = [prim for prim in held.joints if target and target.GetPath() in joint_ends(prim)[1]]
    joint = moving[0] if len(moving) == 1 else None
    carriers = [held.stage.GetPrimAtPath(path) for path in joint_ends(joint)[0]] if joint else []
    carrier = carriers[0] if len(carriers) == 1 and carriers[0] else None
    return replace(held, part=part, target=target or None, joint=joint, carrier=carrier)


def fixed_carrier(held: Contents) -> Usd.Prim | None:
    """Return the last of the bodies that carry the part, one the other; None if a joint among them has no body to hang on."""
    body, seen = held.carrier, set()
    while body and body.GetPath() not in seen:
        seen.add(body.GetPath())
        above = [j for j in held.joints if joint_ends(j)[1] == [body.GetPath()] and joint_ends(j)[0]]
        if not above:
            return body
        body = held.stage.GetPrimAtPath(joint_ends(above[0])[0][0])
    return None


def faces(prim: Usd.Prim) -> np.ndarray:
    """Return a mesh's triangles, shape [face 3]; none if it has other faces, or indices that fit no point."""
    mesh = UsdGeom.Mesh(prim)
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get() or [], int)
    indices = np.asarray(mesh.GetFaceVertexIndicesAttr().Get() or [], int)
    size = len(mesh.GetPointsAttr().Get() or [])
    if (counts != 3).any() or len(indices) != 3 * len(counts) or (len(indices) and not 0 <= indices.max() < size):
        return np.zeros((0, 3), int)
    return indices.reshape(-1, 3)


@dataclass(frozen=True)
class ShapeConfig:
    """Bounds of the static rules about surfaces."""

    # how far a point or face of a collider may lie inside of its convex hull [m]. Float32 points of a fraction of
    # a metre are exact to 1e-7
    dent: NotNegative = 0.0001
    target_hulls: CountFromZero = 32  # most colliders of the part
    site: NotNegative = 0.001  # how far the grasp site may lie from the middle of the grasp region [m]
    # the same of a recessed pull, across the approach [m]. A scanner sees little of the upper wall, so that the
    # mean of what it saw was off by 1 to 4 mm in three
    recess_site: NotNegative = 0.008


STRUCTURE: Suite[Contents, ShapeConfig] = Suite()  # Checks of the prims alone, independent of any simulator

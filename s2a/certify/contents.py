"""What a sim.usd holds, read without trusting it: what is missing is None or empty, and named by a rule."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics

from s2a.errors import InputError
from s2a.usd.sim_stage import FLAVOUR
from s2a.usd.stage import ROOT, reading


@dataclass(frozen=True)
class Contents:
    """The prims that the rules ask.

    Attributes:
        stage: the open stage.
        target: the body that `s2a:target` names, or None.
        joint: the one joint that moves it, or None if there is none or several.
        carcass: the body that it moves against, or None.
        bodies: all rigid bodies.
        joints: all joints.
        meshes: everything with points.
    """

    stage: Usd.Stage
    target: Usd.Prim | None
    joint: Usd.Prim | None
    carcass: Usd.Prim | None
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


def read(path: Path) -> Contents:
    """Open a sim.usd, as it is on disk now.

    Raises:
        InputError: no such file, not USD, or a stage of another flavour, which no certificate is for.
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
    joints = tuple(prim for prim in prims if prim.IsA(UsdPhysics.Joint))
    target = stage.GetPrimAtPath(f"{ROOT}/{root.GetAttribute('s2a:target').Get() or '_'}")
    moving = [prim for prim in joints if target and target.GetPath() in ends(prim)[1]]
    joint = moving[0] if len(moving) == 1 else None
    carriers = [stage.GetPrimAtPath(path) for path in ends(joint)[0]] if joint else []
    return Contents(
        stage=stage,
        target=target or None,
        joint=joint,
        carcass=carriers[0] if len(carriers) == 1 and carriers[0] else None,
        bodies=tuple(prim for prim in prims if prim.HasAPI(UsdPhysics.RigidBodyAPI)),
        joints=joints,
        meshes=tuple(prim for prim in prims if prim.IsA(UsdGeom.PointBased)),
    )


def ends(joint: Usd.Prim) -> tuple[list[str], list[str]]:
    """Return the paths of what a joint holds on to, and of what it moves."""
    physics = UsdPhysics.Joint(joint)
    return physics.GetBody0Rel().GetTargets(), physics.GetBody1Rel().GetTargets()


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


def robot_name(path: Path) -> str:
    """Return the name of the robot that a sim.usd was prepared for; InputError as `read`."""
    held = read(path)
    return held.stage.GetPrimAtPath(ROOT).GetAttribute("s2a:robot").Get() or "panda"

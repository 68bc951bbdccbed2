"""Which bodies of a simulation-ready room move in a world; all others become part of what they are fixed to.

The file is opened without its visuals, and a session layer over it says what differs, so that Newton imports the file natively.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from pxr import Usd, UsdGeom, UsdPhysics, Vt

from s2a.core.errors import InputError
from s2a.scene.geometry.convex import cut_free
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom
from s2a.scene.usd.stage import ROOT, read_mesh

WELDED = "frozen_"
"""Before the id of a frozen part: the prim below its carrier that takes its colliders."""


def kept_bodies(room: SimRoom, active: Sequence[str]) -> tuple[str, ...]:
    """Return the bodies of a world: the active ones and those that carry them.

    Raises:
        InputError: an active one is neither an articulated part nor a free object of the room.
    """
    for i in active:
        if i not in room.articulations and i not in room.free:
            known = ", ".join([*room.articulations, *room.free])
            raise InputError(f"{i!r} neither moves on a joint nor lies free in room {room.name!r}; possible: {known}")
    # A drawer inside of a door moves with it.
    carriers = {c for i in active if i in room.articulations for c in room.carriers(i) if c in room.fixed}
    return tuple(i for i in (*room.bodies, *room.free) if i in carriers or i in active)


def carrier_of(room: SimRoom, body: str, kept: Collection[str]) -> str | None:
    """Return the nearest kept body that carries a body; None for one that stands in the room or lies free."""
    return next((c for c in room.carriers(body) if c in kept), None) if body in room.articulations else None


def freeze(stage: Usd.Stage, room: SimRoom, kept: Collection[str]) -> None:
    """Freeze, in the session layer of a stage, all bodies that are not kept, at their scanned pose.

    What hangs on a kept body becomes part of that, anything else becomes static.
    """
    stage.SetEditTarget(stage.GetSessionLayer())
    for i in (*room.bodies, *room.free):
        prim = stage.GetPrimAtPath(f"{ROOT}/{i}")
        if prim.HasAPI(UsdPhysics.FilteredPairsAPI):  # Newton knows no frozen bodies
            pairs = UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel()
            pairs.SetTargets([path for path in pairs.GetTargets() if i in kept and path.name in kept])
        joint = stage.GetPrimAtPath(f"{ROOT}/joints/{i}")
        carrier = carrier_of(room, i, kept)
        if i in kept:
            if carrier is not None:  # of a drawer inside of a frozen door: the cabinet that this one hangs on
                UsdPhysics.Joint(joint).GetBody0Rel().SetTargets([f"{ROOT}/{carrier}"])
            continue
        if joint:
            joint.SetActive(False)
        if carrier is None:
            for api in (UsdPhysics.RigidBodyAPI, UsdPhysics.ArticulationRootAPI, UsdPhysics.MassAPI):
                prim.RemoveAPI(api)
        else:
            welded = UsdGeom.Xform.Define(stage, f"{ROOT}/{carrier}/{WELDED}{i}").GetPrim()
            welded.GetReferences().AddInternalReference(f"{ROOT}/{i}/colliders")
            prim.SetActive(False)


def cut_colliders(prims: Sequence[Usd.Prim], obstacles: Sequence[Mesh]) -> None:
    """Cut colliders free of obstacles in the edit target of their stage; deactivate those of which nothing is left."""
    for prim in prims:
        whole = read_mesh(prim)
        left: Mesh | None = whole
        for obstacle in obstacles:
            left = None if left is None else next(iter(cut_free(left, obstacle)), None)
        if left is None:
            prim.SetActive(False)
        elif left is not whole:
            mesh = UsdGeom.Mesh(prim)
            mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(left.vertices))
            mesh.GetFaceVertexCountsAttr().Set(Vt.IntArray(len(left.faces), 3))
            mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(left.faces.ravel()))


def owner(label: str) -> str:
    """Return the body that a collider belonged to before it was frozen, from the path of its prim."""
    names = label.split("/")  # "", "scene", body, "colliders" or WELDED + part, hull
    return names[3].removeprefix(WELDED) if len(names) > 3 and names[3].startswith(WELDED) else names[2]

"""What a simulation-ready stage must hold for a simulation to end at all; `s2a certify` asks for far more."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdPhysics

from s2a.core.errors import InputError
from s2a.scene.usd.sim_read import open_physics, read
from s2a.scene.usd.sim_scene import PREPARE_AGAIN, SimBody
from s2a.scene.usd.stage import where


def refuse_unphysical(path: Path) -> None:
    """Raise an InputError for a stage with NaN, a mass that no body has, a joint without bodies or a hull without volume.

    Args:
        path: a simulation-ready room.
    """
    stage = open_physics(path)  # which must outlive its prims
    for prim in stage.Traverse():
        _check_numbers(prim)
        if prim.IsA(UsdPhysics.Joint):
            _check_joint(prim)
    room = read(path, visuals=False)
    for body in (*room.bodies.values(), *room.free.values()):
        _check_body(body, path)
    _check_hulls([collider.mesh.vertices for collider in room.static_colliders], f"{path}: the room")


def _check_numbers(prim: Usd.Prim) -> None:
    """Raise if an authored number of a prim is NaN; infinity may stand for "no limit"."""
    for attribute in prim.GetAuthoredAttributes():
        try:
            numbers = np.asarray(attribute.Get(), dtype=np.float64)
        except (TypeError, ValueError):  # a text, or something else that is no number
            continue
        if np.isnan(numbers).any() and attribute.Get() is not None:
            raise InputError(f"{where(prim)}: {attribute.GetName()} is not a number; {PREPARE_AGAIN}")


def _check_joint(prim: Usd.Prim) -> None:
    """Raise unless a joint moves a body, against another one or the world."""
    joint, stage = UsdPhysics.Joint(prim), prim.GetStage()
    moved, against = joint.GetBody1Rel().GetTargets(), joint.GetBody0Rel().GetTargets()
    bodies = [stage.GetPrimAtPath(path) for path in (*moved, *against)]
    if len(moved) != 1 or len(against) > 1 or not all(body and body.HasAPI(UsdPhysics.RigidBodyAPI) for body in bodies):
        given = ", ".join(map(str, (*moved, *against))) or "nothing"
        raise InputError(f"{where(prim)} joins {given}; expected rigid bodies of the stage: {PREPARE_AGAIN}")


def _check_body(body: SimBody, path: Path) -> None:
    """Raise if a body has no mass and inertia, or no hull with a volume."""
    mass, inertia = body.mass.mass, np.array(body.mass.inertia)
    if not 0.0 < mass < np.inf or not ((inertia > 0.0) & (inertia < np.inf)).all():
        given = ", ".join(f"{moment:g}" for moment in inertia)
        raise InputError(
            f"{path}: {body.id} has mass {mass:g} kg and inertia {given}; expected numbers above 0: {PREPARE_AGAIN}"
        )
    _check_hulls([collider.mesh.vertices for collider in body.colliders], f"{path}: {body.id}")


def _check_hulls(hulls: list[np.ndarray], owner: str) -> None:
    """Raise if a hull has no volume."""
    for points in hulls:
        if len(points) < 4 or np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-9) < 3:
            raise InputError(f"{owner} has a collision hull of {len(points)} points without volume; {PREPARE_AGAIN}")

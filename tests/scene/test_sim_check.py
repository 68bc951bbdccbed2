"""Stages on which a simulation would not end, or not begin: each is one line before anything is built."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from cabinet import write_cabinet
from pxr import Gf, Sdf, Usd, UsdPhysics, Vt

from s2a.core.errors import InputError
from s2a.scene.usd.sim_read import refuse_unphysical

NAN = math.nan
DRAWER, JOINT, STATIC = "/scene/drawer_2", "/scene/joints/drawer_2", "/scene/static"


def hull(stage: Usd.Stage, below: str) -> Usd.Prim:
    """Return the first collider below a prim."""
    prims = Usd.PrimRange(stage.GetPrimAtPath(below))
    return next(prim for prim in prims if prim.HasAPI(UsdPhysics.CollisionAPI))


def points(stage: Usd.Stage, below: str, value: list) -> None:
    hull(stage, below).GetAttribute("points").Set(Vt.Vec3fArray([Gf.Vec3f(*point) for point in value]))
    if not value:
        hull(stage, below).GetAttribute("faceVertexCounts").Set(Vt.IntArray())
        hull(stage, below).GetAttribute("faceVertexIndices").Set(Vt.IntArray())


def number(path: str, name: str, value: object) -> object:
    """Return an edit of an attribute."""
    return lambda stage: stage.GetPrimAtPath(path).GetAttribute(name).Set(value)


EDITS = {
    "mass nan": number(DRAWER, "physics:mass", NAN),
    "mass negative": number(DRAWER, "physics:mass", -5.0),
    "mass zero": number(DRAWER, "physics:mass", 0.0),
    "mass infinite": number(DRAWER, "physics:mass", math.inf),
    "inertia nan": number(DRAWER, "physics:diagonalInertia", Gf.Vec3f(NAN)),
    "inertia negative": number(DRAWER, "physics:diagonalInertia", Gf.Vec3f(-1.0)),
    "centre nan": number(DRAWER, "physics:centerOfMass", Gf.Vec3f(0, 0, NAN)),
    "limit nan": number(JOINT, "physics:upperLimit", NAN),
    "limits nan": number(JOINT, "s2a:limits", Gf.Vec2d(NAN)),
    "frame nan": number(JOINT, "physics:localPos0", Gf.Vec3f(NAN)),
    "hull nan": lambda stage: points(stage, DRAWER, [(NAN, 0, 0)] * 8),
    "hull empty": lambda stage: points(stage, DRAWER, []),
    "hull flat": lambda stage: points(stage, DRAWER, [(0, 0, 0)] * 8),
    "room hull flat": lambda stage: points(stage, STATIC, [(k % 2, k // 2, 0) for k in range(8)]),
    "no body": lambda stage: UsdPhysics.Joint(stage.GetPrimAtPath(JOINT)).GetBody1Rel().SetTargets([]),
    "no bodies": lambda stage: [relation.SetTargets([]) for relation in stage.GetPrimAtPath(JOINT).GetRelationships()],
    "another body": lambda stage: (
        UsdPhysics.Joint(stage.GetPrimAtPath(JOINT)).GetBody0Rel().SetTargets(["/scene/gone"])
    ),
    "no rigid body": lambda stage: UsdPhysics.Joint(stage.GetPrimAtPath(JOINT)).GetBody0Rel().SetTargets([STATIC]),
}


def test_a_stage_as_prepared_is_accepted(tmp_path: Path) -> None:
    refuse_unphysical(write_cabinet(tmp_path / "sim.usd"))


@pytest.mark.parametrize("name", EDITS)
def test_a_stage_that_cannot_be_simulated_is_one_line(tmp_path: Path, name: str) -> None:
    path = write_cabinet(tmp_path / "sim.usd")
    stage = Usd.Stage.Open(str(path))
    EDITS[name](stage)
    Sdf.Layer.Find(str(path)).Save()
    with pytest.raises(InputError) as error:
        refuse_unphysical(path)
    assert "\n" not in str(error.value) and str(tmp_path) in str(error.value)

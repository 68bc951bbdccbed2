"""Static checks of a sim.usd: its units, bodies, joints, masses, colliders and grasps."""

import math

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdUtils
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from s2a.certify.contents import STRUCTURE, Contents, ShapeConfig, faces, fixed_carrier
from s2a.core.check import Check, at_most, no_problems
from s2a.scene import scene
from s2a.scene.usd.joints import KINDS, is_body, joint_ends
from s2a.scene.usd.sim_scene import PREPARE_AGAIN
from s2a.scene.usd.stage import ROOT, broken_rules, read_attribute, world_points, world_pose

EXACT = 1e-6  # Largest difference of an exact value and its float32 copy [m or 1]
NEAR_CENTER = 0.05  # [m] between a free body's frame and its centre of mass; at 5 m a stapler's motion becomes NaN
# [m] How far the region of a recessed pull may lie behind its grasp site, which is where a tool
# frame is: behind fingertips
DEEPEST = 0.03
OPEN = 0.02  # Fraction of its hull's volume that a collider may lack: more is a hole or a dent


@STRUCTURE.check("room", needed_for="images")
def units(contents: Contents, config: ShapeConfig) -> Check:
    """Metres, kilograms, z up, gravity down."""
    stage, problems = contents.stage, []
    if UsdGeom.GetStageMetersPerUnit(stage) != 1.0:
        problems.append((ROOT, f"metersPerUnit is {UsdGeom.GetStageMetersPerUnit(stage):g}, not 1"))
    if UsdPhysics.GetStageKilogramsPerUnit(stage) != 1.0:
        problems.append((ROOT, f"kilogramsPerUnit is {UsdPhysics.GetStageKilogramsPerUnit(stage):g}, not 1"))
    if UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.z:
        problems.append((ROOT, f"upAxis is {UsdGeom.GetStageUpAxis(stage)}, not Z"))
    scenes = [UsdPhysics.Scene(prim) for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene)]
    down = [s for s in scenes if Gf.IsClose(s.GetGravityDirectionAttr().Get(), Gf.Vec3f(0, 0, -1), 1e-6)]
    if len(scenes) != 1 or not down:
        problems.append((ROOT, f"{len(scenes)} physics scenes, {len(down)} with gravity along -z; expected one"))
    return no_problems("units", problems, "convert the stage to metres, kilograms and z up", "metres, kilograms, z up")


@STRUCTURE.check("room", needed_for="images")
def self_contained(contents: Contents, config: ShapeConfig) -> Check:
    """Nothing of the stage lies in another file, but the visuals in one beside it; nothing is instanced."""
    stage, problems = contents.stage, []
    for prim in stage.TraverseAll():
        if prim.IsInstance() or prim.IsPrototype():
            problems.append((str(prim.GetPath()), "an instance"))
        if prim.HasAuthoredReferences() or prim.HasAuthoredInherits():
            problems.append((str(prim.GetPath()), "a reference"))
        own = (spec for spec in prim.GetPrimStack() if spec.layer == stage.GetRootLayer())
        payloads = [arc.assetPath for spec in own for arc in spec.payloadList.GetAddedOrExplicitItems()]
        if payloads and (prim.GetName() != "visual" or any("/" in path.removeprefix("./") for path in payloads)):
            problems.append(
                (str(prim.GetPath()), f"a payload, {payloads[0]!r}, that is no visual in a file beside this one")
            )
    _, _, missing = UsdUtils.ComputeAllDependencies(stage.GetRootLayer().identifier)
    problems += [(ROOT, f"the file {name!r} cannot be found") for name in missing]
    remedy = "flatten the stage, or put its visuals beside it"
    return no_problems("self_contained", problems, remedy, "one file and its visuals, nothing instanced")


@STRUCTURE.check(needed_for="images")
def target(contents: Contents, config: ShapeConfig) -> Check:
    """The part that the joint is named after is a rigid body."""
    name, problems = contents.part, []
    if not name:
        problems.append((f"{ROOT}/joints", "no joint moves anything"))
    elif not is_body(contents.target):
        problems.append((f"{ROOT}/{name}", f"the joint {name!r} has no rigid body of its name"))
    elif contents.joint and contents.joint.GetName() != name:
        problems.append((str(contents.joint.GetPath()), f"the joint that moves {name!r} has another name"))
    return no_problems("target", problems, PREPARE_AGAIN, f"{name!r} moves", f"{ROOT}/{name}")


@STRUCTURE.check("room")
def bodies(contents: Contents, config: ShapeConfig) -> Check:
    """Bodies are siblings; what hangs on a joint stands at the identity, what is free at its centre of mass."""
    problems = []
    moved = {path for joint in contents.joints for path in joint_ends(joint)[1]}
    for body in contents.bodies:
        path, matrix = body.GetPath(), UsdGeom.Xformable(body).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
        turn = np.array(matrix)[:3, :3]
        if path.GetParentPath() != ROOT:
            problems.append((str(path), "a body below another prim than the scene; bodies are siblings"))
        if path not in moved and not contents.colliders_of(body):
            problems.append((str(path), "no joint holds the body and it has no colliders: it falls through everything"))
        if not (np.abs(turn @ turn.T - np.eye(3)).max() <= EXACT and matrix.GetDeterminant() > 0):
            problems.append((str(path), "a transform of the body scales, shears or mirrors"))
        elif path in moved and not Gf.IsClose(matrix, Gf.Matrix4d(1.0), EXACT):
            problems.append((str(path), "a transform moves the body away from its joint's frame"))
        center = UsdPhysics.MassAPI(body).GetCenterOfMassAttr().Get()
        if path not in moved and center is not None and not np.linalg.norm(center) <= NEAR_CENTER:
            problems.append(
                (str(path), f"its frame is {np.linalg.norm(center):.2f} m off its centre of mass: it diverges")
            )
    return no_problems("bodies", problems, PREPARE_AGAIN, f"{len(contents.bodies)} bodies, siblings, each in its frame")


@STRUCTURE.check()
def root_joint(contents: Contents, config: ShapeConfig) -> Check:
    """What carries the part is fixed to the world and is the root of the articulation."""
    problems = []
    roots = [prim for prim in contents.stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)]
    carrier = fixed_carrier(contents)
    if carrier is None:
        problems.append((_path(contents.joint), "the part's joint has no body to move against"))
    else:
        here = carrier.GetPath()
        fixed = [j for j in contents.joints if j.IsA(UsdPhysics.FixedJoint) and joint_ends(j) == ([], [here])]
        if len(fixed) != 1:
            problems.append((str(here), f"{len(fixed)} fixed joints hold what carries the part in the world, not one"))
        if not {p.GetPath() for p in roots} & {here, *(j.GetPath() for j in fixed)}:
            problems.append((str(here), "no articulation root: Newton would leave the joint outside of articulations"))
    return no_problems(
        "root_joint", problems, "fix the cabinet to the world and apply PhysicsArticulationRootAPI to it"
    )


@STRUCTURE.check(needed_for="images")
def target_joint(contents: Contents, config: ShapeConfig) -> Check:
    """One slide or hinge moves the target, between two bodies of the stage."""
    problems = []
    moving = [j for j in contents.joints if contents.target and contents.target.GetPath() in joint_ends(j)[1]]
    if len(moving) != 1:
        problems.append((_path(contents.target), f"{len(moving)} joints move the target, not one"))
    for joint in contents.joints:
        bodies = {body.GetPath() for body in contents.bodies}
        lost = [path for paths in joint_ends(joint) for path in paths if path not in bodies]
        problems += [(str(joint.GetPath()), f"the joint holds {path}, which is no body") for path in lost]
    for joint in moving:
        if joint.GetTypeName() not in KINDS:
            problems.append((str(joint.GetPath()), f"a {joint.GetTypeName()} moves the target, not a slide or hinge"))
        if not joint_ends(joint)[0]:
            text = "the joint's parent is the world: poses stay stale in Newton 1.8; make an anchor body its parent"
            problems.append((str(joint.GetPath()), text))
        if UsdPhysics.Joint(joint).GetJointEnabledAttr().Get() is False:
            problems.append((str(joint.GetPath()), "the joint is switched off"))
    return no_problems("target_joint", problems, PREPARE_AGAIN, prim=_path(contents.joint))


@STRUCTURE.check()
def joint_limits(contents: Contents, config: ShapeConfig) -> Check:
    """The exact limits are ordered, hold the scanned pose, are of a piece of furniture, and the physics limits agree."""
    name, joint = "joint_limits", contents.joint
    if joint is None or joint.GetTypeName() not in KINDS:
        return _unasked(name, "target_joint")
    low, high = joint.GetAttribute("s2a:limits").Get() or (math.nan, math.nan)
    turn = math.degrees(1.0) if joint.GetTypeName() == "PhysicsRevoluteJoint" else 1.0
    physics = [joint.GetAttribute(f"physics:{end}Limit").Get() for end in ("lower", "upper")]
    problems = scene.problems(KINDS[joint.GetTypeName()], low, high)
    if not all(
        value is not None and abs(value / turn - exact) <= EXACT * max(1.0, abs(exact))
        for value, exact in zip(physics, (low, high), strict=True)
    ):
        problems.append(f"physics limits {physics[0]} to {physics[1]} differ from s2a:limits {low:g} to {high:g}")
    path = str(joint.GetPath())
    remedy = "correct the annotation's range (metres or radians, from the scanned pose) and " + PREPARE_AGAIN
    return no_problems(name, [(path, text) for text in problems], remedy, f"{low:.3f} to {high:.3f}", path)


@STRUCTURE.check()
def joint_frames(contents: Contents, config: ShapeConfig) -> Check:
    """The exact axis and origin agree with the physics frames in both bodies."""
    name, joint = "joint_frames", contents.joint
    if joint is None:
        return _unasked(name, "target_joint")
    axis, origin = (joint.GetAttribute(f"s2a:{key}").Get() for key in ("axis", "origin"))
    letter = joint.GetAttribute("physics:axis").Get()
    worst = math.nan
    if axis is not None and origin is not None and letter in ("X", "Y", "Z"):
        physics, worst = UsdPhysics.Joint(joint), abs(float(np.linalg.norm(axis)) - 1.0)
        unit = Gf.Vec3d(*np.eye(3)["XYZ".index(letter)])
        for rotation, place in (
            (physics.GetLocalRot0Attr(), physics.GetLocalPos0Attr()),
            (physics.GetLocalRot1Attr(), physics.GetLocalPos1Attr()),
        ):
            # Not Gf.Rotation: it goes through the angle, of which acos loses half the digits near zero.
            turned = Gf.Quatd(rotation.Get() or Gf.Quatf(math.nan)).Transform(unit)
            scale = max(1.0, float(np.abs(origin).max()))
            away = np.subtract(place.Get() or [math.nan] * 3, origin) / scale
            worst = float(np.max([worst, np.abs(np.subtract(turned, axis)).max(), np.abs(away).max()]))
        # Frames turned against each other about the axis itself would move a hinge's zero.
        here, there = (np.array([q.GetReal(), *q.GetImaginary()]) for q in _turns(physics))
        worst = float(np.max([worst, min(np.abs(here - there).max(), np.abs(here + there).max())]))
    return at_most(
        name, worst, EXACT, prim=str(joint.GetPath()), message="axis and origin against the physics frames",
        remedy="write axis and origin through s2a, which keeps both in step; " + PREPARE_AGAIN,
    )  # fmt: skip


@STRUCTURE.check("room")
def mass(contents: Contents, config: ShapeConfig) -> Check:
    """Masses and principal moments are positive and possible: no moment is larger than the other two together."""
    problems = []
    for body in contents.bodies:
        api, path = UsdPhysics.MassAPI(body), str(body.GetPath())
        value, inertia = api.GetMassAttr().Get() or 0.0, sorted(api.GetDiagonalInertiaAttr().Get() or (0.0,) * 3)
        center = api.GetCenterOfMassAttr().Get()
        if not (math.isfinite(value) and value > 0):
            problems.append((path, f"a mass of {value:g} kg"))
        if not (np.isfinite(inertia).all() and inertia[0] > 0):
            problems.append((path, f"principal moments {np.round(inertia, 4).tolist()} kg m^2"))
        elif inertia[2] > (inertia[0] + inertia[1]) * (1.0 + 1e-5):
            problems.append((path, f"moments {np.round(inertia, 4).tolist()} that no body has (triangle inequality)"))
        if center is None or not np.isfinite(center).all():
            problems.append((path, f"the centre of mass is {center}"))
    return no_problems("mass", problems, "author mass, centre and inertia; " + PREPARE_AGAIN)


@STRUCTURE.check("room", needed_for="nothing")
def usd(contents: Contents, config: ShapeConfig) -> Check:
    """Everything that usd-core itself checks."""
    problems = [(_mentioned(line), line) for line in broken_rules(contents.stage)]
    return no_problems("usd", problems, "see the rule's name in OpenUSD's documentation", "all validators of usd-core")


@STRUCTURE.check("room", needed_for="images")
def finite(contents: Contents, config: ShapeConfig) -> Check:
    """Every coordinate of every surface is a number."""
    bad = [(str(prim.GetPath()), int((~np.isfinite(world_points(prim))).any(axis=1).sum())) for prim in contents.meshes]
    problems = [(path, f"{count} points are not finite") for path, count in bad if count]
    return no_problems("finite", problems, "correct the scan's points and export it again", f"{len(bad)} surfaces")


@STRUCTURE.check("room")
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


@STRUCTURE.check("room")
def convex(contents: Contents, config: ShapeConfig) -> Check:
    """Every collider is a closed convex surface; MuJoCo would silently fill what is not."""
    worst, where, message = 0.0, "", f"{len(contents.colliders)} colliders against their convex hulls"
    for prim in contents.colliders:
        depth = dent(world_points(prim), faces(prim))
        if not depth <= worst:
            worst, where = depth, str(prim.GetPath())
    remedy = "decompose the collider into convex hulls; " + PREPARE_AGAIN
    return at_most("convex", worst, config.dent, "m", prim=where, message=message, remedy=remedy)


def dent(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Return how far a surface's points and face centres reach into its convex hull [m]; inf if it is flat or not closed.

    `vertices`: shape [vertex 3]; `triangles`: shape [face 3].
    """
    if len(triangles) < 4 or not np.isfinite(vertices).all():
        return math.inf
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        return math.inf
    samples = np.concatenate([vertices, vertices[triangles].mean(axis=1)])
    depth = -(samples @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    volume = abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0
    return float(max(0.0, depth.max())) if volume > (1.0 - OPEN) * hull.volume else math.inf


@STRUCTURE.check(needed_for="nothing")
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


@STRUCTURE.check(needed_for="images")
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


@STRUCTURE.check(needed_for="nothing")
def grasp_site(contents: Contents, config: ShapeConfig) -> Check:
    """The grasp site is the mean of the annotated grasp region; of a recessed pull before its middle, seen along the approach."""
    name = "grasp_site"
    site, region = (contents.target and contents.target.GetChild(key) for key in ("grasp", "region"))
    if not site or not region or not len(faces(region)):
        return Check(name, "skipped", message="requires check grasp_and_base")
    place, orientation = world_pose(site)
    a, b, c = np.moveaxis(world_points(region)[faces(region)], 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    away, limit = np.average((a + b + c) / 3.0, axis=0, weights=areas) - place, config.site
    if read_attribute(site, "internal", bool, False):
        away = Rotation.from_quat(orientation).inv().apply(away)
        away, limit = away * ([1, 1, 0] if 0.0 <= away[2] <= DEEPEST else [1, 1, 1]), config.recess_site
    return at_most(
        name, float(np.linalg.norm(away)), limit, "m", prim=str(site.GetPath()),
        message="from the middle of the grasp region", remedy="put the site where the region is; " + PREPARE_AGAIN,
    )  # fmt: skip


def _turns(joint: UsdPhysics.Joint) -> tuple[Gf.Quatf, Gf.Quatf]:
    nothing = Gf.Quatf(math.nan)
    return joint.GetLocalRot0Attr().Get() or nothing, joint.GetLocalRot1Attr().Get() or nothing


def _unasked(name: str, needs: str) -> Check:
    return Check(name, "skipped", message=f"requires check {needs}")


def _path(prim: Usd.Prim | None) -> str:
    return str(prim.GetPath()) if prim else ROOT


def _mentioned(line: str) -> str:
    """Return the path of the first prim that a validator's message names."""
    words = (word.strip("<>'\"(),.;:") for word in line.split())
    return next((word for word in words if word.startswith(ROOT)), ROOT)

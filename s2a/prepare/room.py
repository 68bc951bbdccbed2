"""Scene -> simulation-ready room: every articulated part with the colliders, grasp and base pose that a robot needs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from s2a import robot
from s2a.core.bounds import NotNegative
from s2a.core.outputs import Output, atomic_write
from s2a.prepare.base_pose import ASSUMED_FLOOR, BaseConfig
from s2a.prepare.free_objects import FreeConfig, FreeObject, free_objects, level_tops
from s2a.prepare.grasp import bodies, parent_body
from s2a.prepare.mass import MassConfig, box_mass, cabinet_walls, moving_mass
from s2a.prepare.neighbours import filtered_pairs, trim_apart
from s2a.prepare.part import PartConfig, PartResult, selected_parts
from s2a.prepare.part_hulls import CabinetConfig, ColliderConfig, anchor, cabinet_body
from s2a.prepare.refine import Refined, refine, sentence, with_joints
from s2a.prepare.refine_loss import RefineConfig
from s2a.prepare.room_hulls import LevelTop, RoomConfig, StaticRoom, below_tops, cut_out
from s2a.robot import Robot
from s2a.robot.spec import RobotSpec
from s2a.scene.articulation import lever_arm
from s2a.scene.geometry.convex import column, contains
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.simplify import DecimateConfig
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd import geometric, sim_stage
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT, Articulation, Base, Collider, SimBody, SimRoom

ROBOTS = ""  # Stands for the owner of the places where robots stand, beside ids of objects
UNEVEN = 0.01  # [m] A scanned floor may rise by so much under a robot's base
# Note of a room without articulated parts
NO_JOINTS = "nothing moves: the scan has no joints; `s2a annotate` adds drawers and doors"
HELD = 0.03  # [m] From the grasp point: where fingers lie on a part without a handle
GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class PrepareConfig:
    """Settings of the preparation.

    Attributes:
        friction: min dry friction of an articulated part's joint as a force at the grasp point [N]; holds a drawer whose
            annotated axis is not quite horizontal.
        friction_coefficient: the same as a fraction of its weight, where that is more.
        interior: Enable the open box behind a drawer's front, and the back and sides of its furniture, where a scan cannot
            show them.
        base: where the robot may stand.
        decimate: the static room's visual.
        colliders: the convex hulls of the articulated parts.
        cabinet: those of the furniture that they belong to.
        room: those of the static room.
        mass: mass of articulated parts.
        free: objects extracted from the room.
    """

    friction: NotNegative
    friction_coefficient: NotNegative
    interior: bool
    base: BaseConfig
    decimate: DecimateConfig
    colliders: ColliderConfig
    cabinet: CabinetConfig
    room: RoomConfig
    mass: MassConfig
    free: FreeConfig

    def part(self, spec: RobotSpec) -> PartConfig:
        """Return what one articulated part's share depends on."""
        return PartConfig(self.interior, self.room.clearance, self.base, self.colliders, self.cabinet, spec)


@dataclass(frozen=True)
class PrepareSettings:
    """Keys of `s2a prepare`: what is prepared, and how.

    Attributes:
        stage: the geometric.usd.
        targets: articulated parts that a robot can move: all, the id of one such as drawer_7, several, or none: []; all others
            are frozen.
        free: ids of objects that become free bodies instead of part of the room, such as [teddy_bear_12].
        out: the sim.usd to write; its visuals are written beside it.
        robot: the robot that is to move them, such as panda or baxter.
        prepare: how the scene is prepared.
        refine_joints: Correct annotated joints by what the scan shows of their parts and furniture (docs/refinement.md).
        refine: trust in furniture and annotations.
    """

    stage: Path
    targets: str | tuple[str, ...]
    free: tuple[str, ...]
    out: Output
    robot: Robot
    prepare: PrepareConfig
    refine_joints: bool
    refine: RefineConfig


def prepare_stage(settings: PrepareSettings) -> SimRoom:
    """Write the simulation-ready room of a geometric stage, its visuals beside it; return the room.

    Raises:
        InputError: as `prepare`; the stage cannot be read, or no file can lie beside `settings.out`.
    """
    visuals = sim_stage.visuals_file(settings.out)
    scene = geometric.read(settings.stage)
    refined = refine(scene, settings.refine) if settings.refine_joints else {}
    room = prepare(with_joints(scene, refined), settings.targets, settings.prepare, settings.free, settings.robot)
    room = _refined(room, refined)
    with atomic_write(visuals) as beside, atomic_write(settings.out) as file:
        sim_stage.write(room, file, beside)
    return room


def _refined(room: SimRoom, refined: Mapping[str, Refined]) -> SimRoom:
    """Return a room whose refined joints carry how far they were moved."""
    changed = {
        part: replace(
            articulation,
            refinement=refined[part].change,
            notes=(*articulation.notes, sentence(part, refined[part].change)),
        )
        for part, articulation in room.articulations.items()
        if part in refined
    }
    return replace(room, articulations=room.articulations | changed)


def prepare(
    scene: Scene,
    targets: str | Sequence[str],
    config: PrepareConfig,
    free: Sequence[str] = (),
    spec: RobotSpec | None = None,
) -> SimRoom:
    """Return what a simulator needs of a room.

    Args:
        scene: the room.
        targets: ids of the parts that move, or "all": every one that can be prepared; the others are left out with a warning.
            Joints that are not among them are frozen at the scanned pose.
        config: how.
        free: ids of objects that become free bodies instead of part of the room.
        spec: the robot that is to move them; None: the Panda.

    Raises:
        InputError: a part that was asked for by its id is unknown, does not move, has limits that no robot can use, or has no
            surface; nothing can be prepared; an object cannot be extracted.
    """
    chosen = (targets,) if isinstance(targets, str) else tuple(dict.fromkeys(targets))
    spec = spec or robot.load(DEFAULT_ROBOT)
    still = StaticRoom(scene, config.room, config.decimate)
    results = selected_parts(scene, chosen, config.part(spec), None if free else still.ahead, needed=not free)
    extracted = free_objects(scene, free, tuple(results), config.free)
    owners = bodies(scene, results)
    obstacles = _obstacles(scene, results, extracted, config)
    tops = level_tops(extracted)
    fixed = _fixed_bodies(scene, results, owners, obstacles, tops, config)
    moving = {part: _moving_body(scene, result, config) for part, result in results.items()}
    joints = {part: result.target.joint for part, result in results.items()}
    parents = {part: parent_body(scene, part, owners) for part in results}
    handles = {i: _grasped(result) for i, result in results.items()}
    frozen = [i for i in scene.movable if i not in results]
    bodies_apart = trim_apart(fixed | moving, joints, parents, handles, frozen, config.room)
    moving, fixed = ({i: bodies_apart[i] for i in group} for group in (moving, fixed))
    filtered = filtered_pairs(moving, fixed, joints)
    taken = {i for item in extracted for i in item.members}
    static = [i for i, owner in owners.items() if owner is None and i not in taken]
    around = [hull for group in obstacles.values() for hull in group]
    hulls = still.colliders(static)
    colliders, trimmed = cut_out(below_tops(hulls, tops, config.room), around, config.room)
    visual = still.visual(static)
    return SimRoom(
        name=scene.name,
        bodies=fixed | moving,
        articulations={
            part: _articulation(result, parents[part], moving[part], filtered[part], config, spec)
            for part, result in results.items()
        },
        static_visual=visual.mesh,
        static_colliders=(*_supports(extracted, tops, obstacles, config.room), *colliders),
        free={item.body.id: item.body for item in extracted},
        notes=_notes(scene, fixed, trimmed),
        static_parts=visual.parts,
        static_face_part=visual.face_part,
        reductions=visual.reductions,
    )


def _grasped(result: PartResult) -> list[Collider]:
    """Return the colliders at which a part is grasped: its handle and base plate, without one those by the grasp point.

    Where these are all, as those of a flat front, cuts at its edges leave the grasp as it is.
    """
    target = result.target
    if held := {*target.grasp_parts, target.base_plate or target.id} - {target.id}:
        return [collider for collider in result.colliders if collider.part in held]
    near = [each for each in result.colliders if contains(each.mesh, target.point[None], HELD).all()]
    return near if len(near) < len(result.colliders) else []


def _notes(scene: Scene, fixed: Mapping[str, SimBody], trimmed: Sequence[str]) -> tuple[str, ...]:
    """Return in sentences what the room lacks, and what was done to it beyond what was scanned."""
    still = [] if scene.movable else [NO_JOINTS]
    cut = [f"cut where a part moves or a robot stands: {', '.join(trimmed)}"] if trimmed else []
    return (
        *still,
        *cut,
        *(f"back and sides of {i} added: they were not scanned" for i, body in fixed.items() if body.completed),
    )


def _obstacles(
    scene: Scene, results: Mapping[str, PartResult], extracted: Sequence[FreeObject], config: PrepareConfig
) -> dict[str, list[Mesh]]:
    """Return the convex hulls that colliders must leave free, by the object that they are of.

    Of each object with articulated parts: where these move; of ROBOTS: where they stand; of each free object its place. A part
    that belongs to no furniture, as in a scan of which only fronts are annotated, needs the gripper's path too: whatever stands
    around it is one surface there, whose hulls fill the air before the handle.
    """
    spaces: dict[str, list[Mesh]] = {ROBOTS: []}
    for part, result in results.items():
        own = spaces.setdefault(scene.root(part), [])
        own += [*result.swept, *(result.corridor if scene.root(part) in results else ())]
        foot, room = np.array(result.base.position) + [0.0, 0.0, UNEVEN], config.room
        spaces[ROBOTS].append(column(foot, room.base_radius, room.base_height - UNEVEN))
    for item in extracted:
        spaces.setdefault(item.body.id, []).extend(item.space)
    return spaces


def _supports(
    extracted: Sequence[FreeObject],
    tops: Sequence[LevelTop],
    obstacles: Mapping[str, Sequence[Mesh]],
    config: RoomConfig,
) -> list[Collider]:
    """Return what free objects stand on: level tops where nothing else moves and no robot stands, and tops of their own.

    The front of a drawer may reach a millimetre into the top above it, which would lock it. No robot's place is cut out of an
    object's own top: it would fall.
    """
    ids = {item.body.id for item in extracted}
    moving = [hull for owner, hulls in obstacles.items() if owner not in {*ids, ROBOTS} for hull in hulls]
    boxes = [Collider(top.part, each) for top in tops for each in top.boxes]
    own = [item.support for item in extracted if item.support]
    return [*cut_out(own, moving, config)[0], *cut_out(boxes, [*moving, *obstacles[ROBOTS]], config)[0]]


def _fixed_bodies(
    scene: Scene,
    results: Mapping[str, PartResult],
    owners: Mapping[str, str | None],
    obstacles: Mapping[str, Sequence[Mesh]],
    tops: Sequence[LevelTop],
    config: PrepareConfig,
) -> dict[str, SimBody]:
    """Return the cabinets and anchors that articulated parts move against.

    A cabinet leaves the gripper its path to each of its own handles, other objects' parts theirs, and its level tops their
    layer. Its own parts overlap it, as scans of closed furniture do; a joint's two bodies do not collide.
    """
    bodies = {}
    for body in dict.fromkeys(scene.root(part) for part in results):
        own = [result for part, result in results.items() if scene.root(part) == body]
        members = [i for i, owner in owners.items() if owner == body]
        if body in results:
            bodies[f"{body}_anchor"] = anchor(results[body].target)
            continue
        surface = merge([scene.parts[i].mesh for i in members])
        walls = next(filter(None, (cabinet_walls(surface, r.target) for r in own)), []) if config.interior else []
        free = [hull for owner, hulls in obstacles.items() if owner != body for hull in hulls]
        free += [hull for result in own for hull in result.corridor]
        free += [hull for top in tops if scene.root(top.part) == body for hull in top.layer]
        bodies[body] = cabinet_body(scene, members, free, walls, config.cabinet)
    return bodies


def _moving_body(scene: Scene, result: PartResult, config: PrepareConfig) -> SimBody:
    """Return the body of an articulated part, with the box behind a drawer's front where there is one."""
    target = result.target
    visual = merge([*target.surfaces.values(), *result.interior])
    mass, source = moving_mass(scene, tuple(target.surfaces), config.mass)
    completed = sum(len(wall.faces) for wall in result.interior)
    return SimBody(target.id, visual, result.colliders, box_mass(visual, mass, target.frame, source), completed)


def _articulation(
    result: PartResult,
    parent: str,
    body: SimBody,
    filtered: Mapping[str, float],
    config: PrepareConfig,
    spec: RobotSpec,
) -> Articulation:
    """Return how a part moves, where it is grasped, and what was done to it."""
    target, base = result.target, result.base
    grasp, region = target.grasp, target.grasp.region
    notes = [
        f"no contact between {target.id} and {other}: their colliders touch or overlap, by {1000 * depth:.2g} mm, on its path"
        for other, depth in filtered.items()
    ]
    if base.assumed_floor:
        notes.append(f"floor below {spec.name} before {target.id} assumed: {ASSUMED_FLOOR}")
    notes += [f"box behind the front of {target.id} added: it was not scanned"] if body.completed else []
    return Articulation(
        joint=target.joint,
        parent=parent,
        grasp=replace(grasp, region=Mesh(region.vertices, region.faces)),
        bases={
            spec.name: Base(
                base.position,
                base.orientation,
                base.reason,
                base.free,
                base.pedestal,
                spec.base.radius,
                base.assumed_floor,
            )
        },
        friction=_friction(body.mass.mass, config) * lever_arm(target.joint, target.point),
        filtered=tuple(filtered),
        notes=tuple(notes),
    )


def _friction(mass: float, config: PrepareConfig) -> float:
    """Return the dry friction of a joint that carries a mass [kg], as a force at the grasp point [N]."""
    return max(config.friction, config.friction_coefficient * GRAVITY * mass)

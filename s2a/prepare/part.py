"""Results for one articulated part: grasp, colliders, base pose; for many parts on all processors, and cached."""

import dataclasses
import json
import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from s2a.core import workers
from s2a.core.cache import Arrays, find, keep, key
from s2a.core.errors import InputError
from s2a.core.progress import track
from s2a.prepare.base_pose import BaseConfig, BasePose, find_base
from s2a.prepare.grasp import Target, bodies, find_target, target_joint
from s2a.prepare.mass import drawer_box
from s2a.prepare.part_hulls import CabinetConfig, ColliderConfig, find_handle, gripper_corridor, target_colliders
from s2a.robot.spec import RobotSpec
from s2a.scene.geometry.convex import sweep
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh, Scene, pack, unpack
from s2a.scene.usd.sim_scene import Collider, Grasp

FEW = 3  # So many parts are done sooner than a second process has started


@dataclass(frozen=True)
class PartConfig:
    """All settings on which one part's share depends."""

    interior: bool
    clearance: float
    base: BaseConfig
    colliders: ColliderConfig
    cabinet: CabinetConfig
    robot: RobotSpec


@dataclass(frozen=True)
class PartResult:
    """What was found for one articulated part."""

    target: Target  # the part
    colliders: tuple[Collider, ...]  # its convex hulls, those of the box behind a drawer's front last
    interior: tuple[Mesh, ...]  # that box, where it was asked for and is not scanned
    corridor: tuple[Mesh, ...]  # the gripper's path to the handle
    swept: tuple[Mesh, ...]  # convex hulls that cover where it moves, and some clearance
    base: BasePose  # where the robot stands


Asked = tuple[str, tuple[str, ...]]  # An articulated part, and the parts of its body


def part_results(
    scene: Scene, wanted: Sequence[Asked], config: PartConfig, meanwhile: Callable[[], object] | None = None
) -> dict[str, PartResult | InputError]:
    """Return what was found for each part, or why it cannot be prepared.

    `wanted`: articulated parts, each with the parts of its body; `meanwhile`: other work for this process, where
    helpers begin with the parts.
    """
    whole = key([*(part.mesh for part in scene.parts.values()), _facts(scene), repr(config)])
    keys = {part: [whole, part, repr(members)] for part, members in wanted}
    results: dict[str, PartResult | InputError] = {}
    missing = []
    for part, members in wanted:
        entry = find("part", keys[part])
        if entry is None:
            missing.append((part, members))
        else:
            results[part] = _unpacked(scene, part, members, entry)
    work = workers.spread(_try, (scene, config), missing, FEW, meanwhile)
    for (part, members), made in zip(missing, track(work, "parts", len(missing)), strict=True):
        if isinstance(made, InputError):
            results[part] = made
        else:
            keep("part", keys[part], made)
            results[part] = _unpacked(scene, part, members, made)
    return {part: results[part] for part, _ in wanted}


def _try(shared: tuple[Scene, PartConfig], wanted: Asked) -> Arrays | InputError:
    scene, config = shared
    try:
        return _packed(
            _part(find_target(scene, *wanted, spec=config.robot, approach=config.base.approach), scene, config)
        )
    except InputError as error:
        return error


def _part(target: Target, scene: Scene, config: PartConfig) -> PartResult:
    """Return what is found for one part."""
    handle, others = find_handle(target)
    interior = tuple(drawer_box(target)) if config.interior else ()
    colliders = target_colliders(target, handle, others, config.colliders)
    colliders += tuple(Collider(target.id, wall) for wall in interior)
    swept = sweep(merge([target.carried, *(c.mesh for c in colliders)]), target.joint, config.clearance)
    moving = (target.id, *scene.descendants(target.id))
    base = find_base(scene, target.id, target.grasp, moving, swept, config.base, config.robot)
    corridor = gripper_corridor(handle, target, config.cabinet, config.robot.gripper)
    return PartResult(target, colliders, interior, tuple(corridor), tuple(swept), base)


def _packed(result: PartResult) -> Arrays:
    """Return a result as named arrays; what the scene itself holds is left out."""
    groups = {
        "colliders": [collider.mesh for collider in result.colliders],
        "interior": result.interior,
        "corridor": result.corridor,
        "swept": result.swept,
    }
    arrays = {f"{name}_{key}": value for name, group in groups.items() for key, value in pack(group).items()}
    grasp = result.target.grasp
    facts = {
        "owners": [collider.part for collider in result.colliders],
        "grasp": {k: getattr(grasp, k) for k in ("point", "orientation", "size", "internal")},
        "base": dataclasses.asdict(result.base),
    }
    return {**arrays, "facts": np.array(json.dumps(facts))}


def _unpacked(scene: Scene, part: str, members: tuple[str, ...], arrays: Arrays) -> PartResult:
    """Return a result from its arrays and the scene."""

    def group(name: str) -> list[Mesh]:
        return unpack({k.removeprefix(f"{name}_"): v for k, v in arrays.items() if k.startswith(f"{name}_")})

    facts = json.loads(str(arrays["facts"]))
    grasp, base = ({k: _tuples(v) for k, v in facts[name].items()} for name in ("grasp", "base"))
    region = merge([scene.parts[i].mesh for i in scene.handle_parts(part)])
    return PartResult(
        target=find_target(scene, part, members, Grasp(**grasp, region=region)),
        colliders=tuple(Collider(i, mesh) for i, mesh in zip(facts["owners"], group("colliders"), strict=True)),
        interior=tuple(group("interior")),
        corridor=tuple(group("corridor")),
        swept=tuple(group("swept")),
        base=BasePose(**base),
    )


def _tuples(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _facts(scene: Scene) -> str:
    """Return all of a scene but its surfaces, as a text to tell scenes apart by."""
    facts: Iterable[object] = ((i, p.label, p.parent, p.motion, p.graspable) for i, p in scene.parts.items())
    return repr(list(facts))


_log = logging.getLogger(__name__)

ALL = "all"  # Stands for every articulated part of a room
# [m] No scan of rooms is longer; in centimetres or inches every room is, and would be cut into millions of cells
MAX_LENGTH = 100.0


def refuse_other_units(scene: Scene) -> None:
    """Raise an InputError for a scene that cannot be in metres."""
    boxes = np.array([part.mesh.bounds for part in scene.parts.values() if len(part.mesh.faces)])
    length = float((boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)).max()) if len(boxes) else 0.0
    if length > MAX_LENGTH:
        raise InputError(
            f"scene {scene.name!r} is {length:.0f} m long; expected metres, and {MAX_LENGTH:g} of them or less: "
            "`s2a check scan=...` names the unit; scale the scan to metres"
        )


Ahead = Callable[[Sequence[str]], object]  # Work that can be done beside that on the parts with these ids


def selected_parts(
    scene: Scene, targets: Sequence[str], config: PartConfig, ahead: Ahead | None = None, needed: bool = True
) -> dict[str, PartResult]:
    """Return the results of parts by id.

    Args:
        scene: the room.
        targets: ids of the parts, none in a room where nothing moves, or only "all": every part that can be prepared; of the
            others a warning is logged.
        config: settings of each part.
        ahead: done by this process while others begin with the parts.
        needed: One part at least of "all" is to move.

    Raises:
        InputError: a part that is named cannot be prepared; there are articulated parts and none can; the scene is not in metres.
    """
    refuse_other_units(scene)
    return _all(scene, config, ahead, needed) if tuple(targets) == (ALL,) else _exactly(scene, targets, config, ahead)


def _exactly(scene: Scene, parts: Sequence[str], config: PartConfig, ahead: Ahead | None) -> dict[str, PartResult]:
    """Return the results of parts that were asked for by their ids."""
    for part in parts:
        target_joint(scene, part)  # one that cannot move is refused before the first is worked on
    results = _results(scene, parts, config, ahead)
    for result in results.values():
        if isinstance(result, InputError):
            raise result
    return {part: result for part, result in results.items() if isinstance(result, PartResult)}


def _all(scene: Scene, config: PartConfig, ahead: Ahead | None, needed: bool) -> dict[str, PartResult]:
    """Return the results of all articulated parts that can be prepared; warn of the others, which are frozen."""
    parts = scene.movable
    while parts:
        results = _results(scene, parts, config, ahead)
        refused = {part: result for part, result in results.items() if isinstance(result, InputError)}
        for part, error in refused.items():
            _log.warning("%s is left out: %s", part, error)
        # Without those, what they carried belongs to other bodies.
        parts = tuple(part for part in parts if part not in refused)
        if not parts and needed:
            raise InputError(f"scene {scene.name!r} has no articulated part that can be prepared")
        if not refused:
            return {part: result for part, result in results.items() if isinstance(result, PartResult)}
    return {}


def _results(
    scene: Scene, parts: Sequence[str], config: PartConfig, ahead: Ahead | None
) -> dict[str, PartResult | InputError]:
    meanwhile = None if ahead is None else lambda: ahead(parts)
    return part_results(scene, _with_members(scene, parts), config, meanwhile)


def _with_members(scene: Scene, parts: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Return articulated parts with the parts of their bodies."""
    owners = bodies(scene, parts)
    return [(part, tuple(i for i, owner in owners.items() if owner == part)) for part in parts]

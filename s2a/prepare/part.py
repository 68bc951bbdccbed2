"""What one articulated part needs: grasp, colliders, base pose; made for many parts on all processors, and cached."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from s2a.core import workers
from s2a.core.cache import Arrays, find, keep, key
from s2a.core.errors import InputError
from s2a.core.progress import track
from s2a.prepare.base_pose import BaseConfig, BasePose, find_base
from s2a.prepare.colliders.cabinet import CabinetConfig, gripper_corridor
from s2a.prepare.colliders.target import ColliderConfig, find_handle, target_colliders
from s2a.prepare.interior import drawer_box
from s2a.prepare.target import Target, find_target
from s2a.robot.spec import RobotSpec
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.sweep import sweep
from s2a.scene.mesh import pack, unpack
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd.sim_scene import Collider, Grasp

FEW = 3
"""So many parts are done sooner than a second process has started."""


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
    """What was found for one articulated part.

    Attributes:
        target: the part.
        colliders: its convex hulls, those of the box behind a drawer's front last.
        interior: that box, where it was asked for and is not scanned.
        corridor: the gripper's path to the handle.
        swept: convex hulls that cover where it moves, and some clearance.
        base: where the robot stands.
    """

    target: Target
    colliders: tuple[Collider, ...]
    interior: tuple[Mesh, ...]
    corridor: tuple[Mesh, ...]
    swept: tuple[Mesh, ...]
    base: BasePose


Asked = tuple[str, tuple[str, ...]]
"""An articulated part, and the parts of its body."""


def part_results(
    scene: Scene, asked: Sequence[Asked], config: PartConfig, meanwhile: Callable[[], object] | None = None
) -> dict[str, PartResult | InputError]:
    """Return what was found for each part, or why it cannot be prepared.

    Args:
        scene: the room.
        asked: articulated parts, each with the parts of its body.
        config: how.
        meanwhile: other work for this process, where helpers begin with the parts.
    """
    whole = key([*(part.mesh for part in scene.parts.values()), _facts(scene), repr(config)])
    keys = {part: [whole, part, repr(members)] for part, members in asked}
    found: dict[str, PartResult | InputError] = {}
    missing = []
    for part, members in asked:
        entry = find("part", keys[part])
        if entry is None:
            missing.append((part, members))
        else:
            found[part] = _unpacked(scene, part, members, entry)
    work = workers.spread(_try, (scene, config), missing, FEW, meanwhile)
    for (part, members), made in zip(missing, track(work, "parts", len(missing)), strict=True):
        if isinstance(made, InputError):
            found[part] = made
        else:
            keep("part", keys[part], made)
            found[part] = _unpacked(scene, part, members, made)
    return {part: found[part] for part, _ in asked}


def _try(shared: tuple[Scene, PartConfig], asked: Asked) -> Arrays | InputError:
    scene, config = shared
    try:
        return _packed(_part(find_target(scene, *asked, spec=config.robot), scene, config))
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

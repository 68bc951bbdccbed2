"""The part that a robot is to move."""

from __future__ import annotations

from s2a import limits
from s2a.errors import InputError
from s2a.scene import Joint, Scene


def target_joint(scene: Scene, target: str) -> Joint:
    """Return the joint of a part that a robot is to move.

    Raises:
        InputError: the part is unknown, does not move, or its limits leave out the scanned pose, in which every episode
            begins (the joint would throw the part open), or are too near or too far apart for any furniture.
    """
    joint = scene.joint(target)
    if wrong := limits.problems(joint.kind, *joint.limits):
        raise InputError(
            f"part {target!r} of scene {scene.name!r}: {' and '.join(wrong)}; mend rangeMin and rangeMax in the scan's "
            "annotation (metres or radians from the scanned pose) and run s2a export again"
        )
    return joint

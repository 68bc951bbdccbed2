"""Every joint of a scan, three times: as annotated, as Newton moves it, as it truly is.

    python tools/joint_table.py GEOMETRIC_USD TRUTH_USDA

Newton imports the geometric stage as it is; every joint is pushed to both its limits at once. The truth is the furniture
that a virtual scan was taken of; a real scan has none.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import newton
import numpy as np
import warp as wp
from rich.console import Console
from rich.table import Table

from s2a.scene.scene import Joint, Scene
from s2a.scene.usd import geometric
from s2a.sim.world import body_index, joint_index, stiffen

DT, PUSH, SECONDS = 1.0 / 240.0, 30.0, 2.0
MASS = 5.0
"""[kg] of every body, at its joint; the stage has no masses, and where a joint ends does not depend on them."""


@dataclass(frozen=True)
class Reached:
    """Joint coordinates at rest against the lower and the upper limit, pushed by 30 N or 30 N m [m or rad]."""

    lower: float
    upper: float


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", type=Path)
    parser.add_argument("truth", type=Path)
    args = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    scene, truth = geometric.read(args.stage), geometric.read(args.truth)
    reached = push_all(scene, args.stage)
    table = Table("part", "joint", "annotated range", "range reached", "axis error", "off the true axis")
    for part_id in scene.movable:
        table.add_row(*_row(part_id, scene.joint(part_id), reached[part_id], truth.joint(part_id)))
    Console(width=110).print(table)


def push_all(scene: Scene, stage: Path) -> dict[str, Reached]:
    """Push all joints of a geometric stage against their limits in Newton."""
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_usd(str(stage), load_visual_shapes=False)
    for body in range(builder.body_count):
        builder.body_mass[body], builder.body_inertia[body] = MASS, wp.mat33(np.eye(3))
    for part_id in scene.movable:
        builder.body_com[body_index(builder, part_id)] = wp.vec3(*scene.joint(part_id).origin)
    dofs = {i: builder.joint_qd_start[joint_index(builder, i)] for i in scene.movable}
    for dof in dofs.values():
        stiffen(builder, dof, DT)
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True)
    states, control = [model.state(), model.state()], model.control()
    ends = []
    for sign in (-1.0, 1.0):
        control.joint_f.fill_(sign * PUSH)
        for _ in range(round(SECONDS / DT)):
            solver.step(*states, control, None, DT)
            states.reverse()
        ends.append(states[0].joint_q.numpy().copy())
    return {i: Reached(*(float(end[dof]) for end in ends)) for i, dof in dofs.items()}


def _row(part_id: str, joint: Joint, reached: Reached, truth: Joint) -> tuple[str, ...]:
    """Return a row of the table."""
    slides = joint.kind == "prismatic"
    scale, unit = (1e3, "mm") if slides else (180.0 / np.pi, "deg")
    angle = np.degrees(np.arccos(np.clip(np.dot(joint.axis, truth.axis), -1.0, 1.0)))
    # A slide's origin may lie anywhere: only its direction has a truth.
    off = np.linalg.norm(np.cross(np.subtract(joint.origin, truth.origin), truth.axis))
    pairs = np.round(scale * np.array([joint.limits, (reached.lower, reached.upper)]), 2) + 0.0  # + 0.0: no "-0.00"
    ranges = [f"{a:.2f} to {b:.2f} {unit}" for a, b in pairs]
    return (
        part_id,
        "slide" if slides else "hinge",
        *ranges,
        f"{angle:.2f} deg",
        "-" if slides else f"{1e3 * off:.1f} mm",
    )


if __name__ == "__main__":
    main()

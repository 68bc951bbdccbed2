"""Command `s2a register`: find the parts that are open in a second scan of a room, and their joints."""

import math
from dataclasses import dataclass
from pathlib import Path

from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write, refuse_loss
from s2a.core.provenance import provenance
from s2a.joints import register as files
from s2a.joints.register import MIN_OVERLAP, Proposal, register
from s2a.joints.register_surface import OrientedMesh


@dataclass(frozen=True)
class Config:
    """Keys of `s2a register`.

    Attributes:
        closed: folder of the scan with the parts closed; its annotation, if it has one, is not read.
        open: folder of the scan with parts open; scanner poses and objects may differ.
        out: folder that receives the closed scan's mesh with the proposed parts and joints as its annotation, and
            register.json with their uncertainties; or null.
    """

    closed: Path
    open: Path
    out: Output | None


def run(config: Config) -> str:
    """Find the parts that opened; return a line for each.

    Raises:
        InputError: no scan, a damaged one, or scans of two rooms; `out` is a file, or a folder of something else.
    """
    closed, opened = (files.read(path) for path in (config.closed, config.open))
    if config.out:
        refuse_loss(config.out, files.REPORT, [closed.path, opened.path])
    registration = register(*(OrientedMesh(scan.vertices, scan.faces) for scan in (closed, opened)))
    if not registration.one_room:
        raise InputError(
            f"{config.open}: {registration.alignment.overlap:.0%} of its surface lies on {config.closed}, "
            f"at least {MIN_OVERLAP:.0%} do in one room; give two scans of one room with one up axis"
        )
    if config.out:
        with atomic_write(config.out, files.REPORT) as out:
            out.mkdir()
            name = config.closed.resolve().name
            facts = {"closed": str(config.closed), "open": str(config.open), **provenance("cpu")}
            files.write(registration, closed, name, out, **facts)
    lines = [_line(files.label(i, proposal), proposal) for i, proposal in enumerate(registration.proposals)]
    head = f"{len(lines)} parts are open in {config.open} (the scans overlap by {registration.alignment.overlap:.0%})"
    return "\n".join([head, *lines, *([f"  {config.out}"] if config.out else [])])


def _line(label: str, proposal: Proposal) -> str:
    joint, hinge = proposal.joint, proposal.joint.kind == "revolute"
    unit, scale = ("deg", math.degrees(1.0)) if hinge else ("m", 1.0)
    axis = ", ".join(f"{x:.3f}" for x in joint.axis)
    origin = f", origin +- {1e3 * proposal.origin_deviation:.1f} mm" if hinge else ""
    return (
        f"  {label}: {joint.kind}, open by {scale * joint.limits[1]:.3f} +- {scale * proposal.open_deviation:.3f} {unit}, "
        f"axis ({axis}) +- {math.degrees(proposal.axis_deviation):.2f} deg{origin}, {len(proposal.faces)} faces"
    )

"""Two scan folders in, proposed annotations out: the closed scan's mesh, Articulate3D's two files, and all figures."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.joints.register import Proposal, Registration
from s2a.joints.register_surface import OrientedMesh
from s2a.scan import folder, ply
from s2a.scan.ply import ScanMesh

REPORT = "register.json"
"""The file with all figures, by which an earlier output is known."""
NAMES = {"prismatic": "drawer", "revolute": "door"}
"""What a proposed part is called, by the kind of its joint; what it is nobody knows."""
TYPES = {"prismatic": "translation", "revolute": "rotation"}
"""Articulate3D's words."""


def read(path: Path) -> ScanMesh:
    """Read the mesh of a scan's folder, whatever annotations are beside it.

    Raises:
        InputError: no folder, no mesh in it, several, or a damaged one.
    """
    if not path.is_dir():
        what = "is a file" if path.exists() else "does not exist"
        raise InputError(f"{path}: {what}; give the folder of one scan, which holds its mesh ({folder.MESH})")
    return ply.read(folder.find_bare(path).mesh)


def surface(mesh: ScanMesh) -> OrientedMesh:
    """Return a scan's mesh as registration takes it."""
    return OrientedMesh(mesh.vertices, mesh.faces)


def label(index: int, proposal: Proposal) -> str:
    """Return the label of a proposal by its place in the list, such as "drawer.2"."""
    return f"{NAMES[proposal.joint.kind]}.{index + 1}"


def write(found: Registration, mesh: ScanMesh, name: str, out: Path, **facts: Any) -> None:
    """Write proposals as an annotated scan into a folder.

    Args:
        found: the proposals.
        mesh: of the closed scan.
        name: of the scan.
        out: the folder, which exists.
        facts: what else register.json says.
    """
    shutil.copyfile(mesh.path, out / folder.MESH)
    labels = [label(i, proposal) for i, proposal in enumerate(found.proposals)]
    numbered = list(zip(range(1, len(labels) + 1), labels, found.proposals, strict=True))
    parts = [{"partId": n, "objectId": n, "label": text, "triIndices": p.faces.tolist()} for n, text, p in numbered]
    stats = {"totalFaces": len(mesh.faces), "totalVertices": len(mesh.vertices)}
    joints = [joint_record(n, p, mesh.origin) for n, _, p in numbered]
    listed = [{"pid": n, "label": text, "group": "others"} for n, text, _ in numbered]
    model = f"register.{name}"
    _write(out / f"{name}_parts.json", {"modelId": model, "data": {"stats": stats, "annotations": parts}})
    _write(out / f"{name}_artic.json", {"modelId": model, "data": {"parts": listed, "articulations": joints}})
    alignment = {
        "motion": found.alignment.motion.tolist(),
        "overlap": found.alignment.overlap,
        "rms_m": found.alignment.rms,
    }
    figures = [{"label": text} | figures_of(p) for _, text, p in numbered]
    _write(out / REPORT, {**facts, "alignment": alignment, "parts": figures}, indent=1)


def joint_record(number: int, proposal: Proposal, origin: np.ndarray) -> dict[str, Any]:
    """Return Articulate3D's record of a joint; `origin` takes the reader's coordinates to the file's [m], shape [3]."""
    joint = proposal.joint
    return {
        "pid": number,
        "type": TYPES[joint.kind],
        "origin": (np.array(joint.origin) + origin).tolist(),
        "axis": list(joint.axis),
        "base": [],
        "rangeMin": joint.limits[0],
        "rangeMax": joint.limits[1],
    }


def figures_of(proposal: Proposal) -> dict[str, Any]:
    """Return how certain a proposal is: standard deviations in radians and metres, and what it explains."""
    return {
        "kind": proposal.joint.kind,
        "open": proposal.joint.limits[1],
        "faces": len(proposal.faces),
        "explained_m2": proposal.explained,
        "rms_m": proposal.rms,
        "deviations": {
            "axis": proposal.axis_deviation,
            "origin": proposal.origin_deviation,
            "open": proposal.open_deviation,
        },
    }


def _write(path: Path, content: dict[str, Any], indent: int | None = None) -> None:
    path.write_text(json.dumps(content, indent=indent) + "\n", encoding="utf-8")

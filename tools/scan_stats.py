"""How like a real scan a virtual one is: its figures, beside those of real scans.

    python tools/scan_stats.py SCAN... [--recorded FRAMES | --beside MESH] [--out FIGURES.json]

SCAN is a folder written by `s2a sample`, or a PLY mesh, of which only what needs no truth is measured. With --recorded a virtual
depth camera records the true room, `s2a import frames=` fuses it, and what the camera measured and the fused mesh are compared
with the truth instead: rms distances up to 30 mm, and the share farther off. With --beside the scan of a recording is compared
with the mesh of another program in the recording's coordinates (`tools/open3d_fusion.py`).

noise    rms distance of the scan from the true surface, without what is more than 10 mm off (webs, skirts)
holes    connected pieces of border, per square metre of surface; short: shorter than 0.5 m around
webbed   handles with a gap behind them of whose length at least half is closed by surface that is not there
seen     share of the true surface that has scanned surface within 10 mm that faces the same way; floors, walls and
         ceilings count with their outsides and with what furniture covers, as everything else does
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from PIL import Image
from rich.console import Console
from rich.table import Table
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation
from webs import webs

from s2a.commands import import_
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.scan import ply
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.geometry.mesh_ops import merge, normals, sample, sample_with_faces
from s2a.scene.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh, visible_distance
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd import geometric

SAMPLES = 200_000
"""Points by which noise is measured."""
NEAR = 0.010
"""[m] Farther off, a scanned point is no measurement of that surface."""
SHORT = 0.5
"""[m] Length of border below which a hole is short."""

REAL = (
    # ScanNet++ 30f4a2b44d, 4.86 x 3.69 x 3.34 m: 1 304 672 vertices, 278 336 voxels of 2 cm (some 80 to 110 m2).
    ("ScanNet++ 30f4a2b44d", "1305", "12-16 k", "8-10", "", "", "", "", "", "github.com/Uspfe/USDNet, notebook.ipynb"),
    # This tool on scene0470_00_vh_clean_2.ply, 23 m2; its noise: distances from planes, without an upper bound.
    ("ScanNet scene0470_00", "67", "2.9 k", "20.6", "6-11", "5.1", "71 %", "5", "", "github.com/skanti/Scan2CAD"),
    ("MultiScan, documented", "150", "", "", "", "", "", "", "", "github.com/smartscenes/multiscan, annotation.rst"),
    # No data sheet says this: ranging noise of some 1 mm on walls, and what registration of the stations adds.
    ("a Faro laser scanner", "", "", "", "1-2", "", "", "", "", "an estimate, not measured, from no data sheet"),
)
"""What is known of real scans, or estimated where the source says so: a name, the columns of the table after it (without
"seen"), the source."""


@dataclass(frozen=True)
class Figures:
    """What is measured of a scan.

    Attributes:
        scan: name of its folder or file.
        vertices: their number.
        area: of the surface [m^2].
        density: vertices per square metre.
        edge: median length of an edge [m].
        noise: rms distance from the true surface, of points within NEAR [m].
        off: share of the surface farther off than that.
        holes: borders per square metre.
        short: share of borders shorter than SHORT.
        border: its length per square metre [1/m].
        components: connected pieces.
        webs: share of each handle's gap that is closed, by part id.
        seen: share of each object's true surface that was scanned, by part id.
    """

    scan: str
    vertices: int
    area: float
    density: float
    edge: float
    noise: float
    off: float
    holes: float
    short: float
    border: float
    components: int
    webs: dict[str, float]
    seen: dict[str, float]


def measure(scan: Path) -> Figures:
    """Return the figures of a virtual scan, or of a mesh without truth (noise, off: NaN).

    Args:
        scan: folder of a virtual scan, or a PLY file.

    Raises:
        InputError: there is no mesh, or a folder without truth.
    """
    surface = ply.read(scan if scan.is_file() else scan / "mesh_aligned_0.05.ply")
    mesh = Mesh(surface.vertices, surface.faces)
    area, lengths = float(mesh.face_areas.sum()), border_lengths(mesh)
    nothing = {"noise": np.nan, "off": np.nan, "webs": {}, "seen": {}}
    return Figures(
        scan=scan.name,
        vertices=len(mesh.vertices),
        area=area,
        density=len(mesh.vertices) / area,
        edge=median_edge(mesh),
        holes=len(lengths) / area,
        short=float(np.mean(lengths < SHORT)) if len(lengths) else 1.0,
        border=float(lengths.sum()) / area,
        components=components(mesh),
        **(nothing if scan.is_file() else _beside_truth(mesh, scan)),
    )


def _beside_truth(mesh: Mesh, folder: Path) -> dict[str, Any]:
    """Return the figures of a scan that need the truth."""
    truth = geometric.read(folder / "truth" / "truth.usda")
    facts = json.loads((folder / "truth" / "truth.json").read_text())["parts"]
    clean = merge([part.mesh for part in truth.parts.values()])
    gap = nearest_faces(ray_mesh(clean.vertices, clean.faces), sample(mesh, SAMPLES, seed=0))[1]
    poses = {i: np.array(fact["pose"]) for i, fact in facts.items() if fact["style"] not in (None, "knob")}
    return {
        "noise": float(np.sqrt(np.mean(gap[gap < NEAR] ** 2))),
        "off": float(np.mean(gap >= NEAR)),
        "webs": webs(mesh, truth, poses),
        "seen": seen(mesh, truth),
    }


def edges(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return each edge once, shape [edge 2], and the number of faces that have it, shape [edge]."""
    pairs = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    codes, counts = np.unique(pairs[:, 0].astype(np.int64) * len(mesh.vertices) + pairs[:, 1], return_counts=True)
    return np.stack(np.divmod(codes, len(mesh.vertices)), axis=1), counts


def median_edge(mesh: Mesh) -> float:
    """Return the median length of the edges [m]."""
    ends = mesh.vertices[edges(mesh)[0]].astype(np.float64)
    return float(np.median(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)))


def border_lengths(mesh: Mesh) -> np.ndarray:
    """Return the length of each connected piece of border [m], shape [piece]; borders are edges of one face alone."""
    pairs, counts = edges(mesh)
    border = pairs[counts == 1]
    if not len(border):
        return np.empty(0)
    ends = mesh.vertices[border].astype(np.float64)
    return np.bincount(_pieces(border), np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))


def components(mesh: Mesh) -> int:
    """Return the number of pieces of surface that share no vertex."""
    pairs = np.concatenate([mesh.faces[:, :2], mesh.faces[:, 1:]])
    return int(_pieces(pairs).max()) + 1


def _pieces(pairs: np.ndarray) -> np.ndarray:
    """Return the number of the connected piece that each edge belongs to, shape [edge]."""
    used, flat = np.unique(pairs, return_inverse=True)
    ends = flat.reshape(pairs.shape)
    graph = coo_array((np.ones(len(ends), bool), ends.T), shape=(len(used), len(used)))
    return connected_components(graph, directed=False)[1][ends[:, 0]]


def seen(mesh: Mesh, truth: Scene, spacing: float = 0.02) -> dict[str, float]:
    """Return the share of each object's true surface, all its parts together, that the scan shows.

    Args:
        mesh: the scan.
        truth: what was scanned.
        spacing: about the distance between the points that are asked [m].
    """
    scanned, facing = ray_mesh(mesh.vertices, mesh.faces), normals(mesh)
    shares = {}
    for root in (i for i, part in truth.parts.items() if part.parent is None):
        whole = merge([truth.parts[i].mesh for i in (root, *truth.descendants(root))])
        count = int(np.clip(whole.face_areas.sum() / spacing**2, 2_000, 100_000))
        points, faces = sample_with_faces(whole, count, seed=0)
        near, _ = nearest_faces(scanned, points, NEAR)
        alike = np.einsum("ij,ij->i", facing[near], normals(whole)[faces]) > 0.3
        shares[root] = float(np.mean(alike & (near >= 0)))
    return shares


WIDTH, HEIGHT, FOCAL, REACH = 320, 240, 262.5, 4.0
"""Of the virtual depth camera: every second row and column of a Kinect [pixel], and its reach [m]."""
DEPTH_NOISE, POSE_NOISE, TURN_NOISE = (0.0012, 0.0019), 0.002, 0.001
"""Standard deviations of a depth z: a + b (z - 0.4 m)^2 [m] (Nguyen, Izadi and Lovell, 3DIM 2012), and of each frame's place [m]
and direction [rad], as of the detail `rgbd`."""
MATCHED = 0.030
"""[m] Farther off, a point of a recording is no measurement of a surface: an edge, a web."""


def recorded(scan: Path, frames: int, seed: int) -> dict[str, Any]:
    """Return the errors of a virtual recording of a home and of the mesh that `s2a import` fuses of it [m].

    Args:
        scan: folder of a virtual scan, of which the truth is recorded.
        frames: their number; the camera is at places in the room's free interior, at eye height, and looks around.
        seed: of places, directions and noise.
    """
    truth, rng = geometric.read(scan / "truth" / "truth.usda"), np.random.default_rng(seed)
    clean = merge([part.mesh for part in truth.parts.values()])
    tree, places = ray_mesh(clean.vertices, clean.faces), ScanSurface(truth).viewpoints
    places = places[(places[:, 2] > 0.8) & (places[:, 2] < 2.0)]
    if not len(places):
        raise SystemExit(f"{scan}: no free place for a camera between 0.8 and 2.0 m; give another SCAN")
    with tempfile.TemporaryDirectory() as temporary:
        walk, out = Path(temporary) / "walk", Path(temporary) / "scan"
        walk.mkdir()
        np.savetxt(walk / "camera-intrinsics.txt", [[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
        points = [_frame(tree, places[rng.integers(len(places))], walk, index, rng) for index in range(frames)]
        keys = {"frames": str(walk), "out": str(out), "up": "z", "unit": "m", "level": False, "floor": False}
        import_.run(config.load(import_.Config, {**config.compose("import", (), import_.Config), **keys}))
        fused = ply.read(out / "mesh_aligned_0.05.ply")
    errors = {"camera": np.concatenate(points), "fused": sample(Mesh(fused.vertices, fused.faces), SAMPLES, seed=0)}
    row: dict[str, Any] = {"scan": scan.name, "frames": frames, "seed": seed}
    for name, measured in errors.items():
        gap = nearest_faces(tree, measured)[1]
        row |= {
            f"{name}_rms": float(np.sqrt(np.mean(gap[gap < MATCHED] ** 2))),
            f"{name}_off": float((gap >= MATCHED).mean()),
        }
        row[f"{name}_median"] = float(np.median(gap))
    return row


def _frame(tree: RayMesh, place: np.ndarray, folder: Path, index: int, rng: np.random.Generator) -> np.ndarray:
    """Write a depth image and its pose as 7-Scenes does; return some of its points as they are believed to be [point 3]."""
    yaw, pitch = rng.uniform(-np.pi, np.pi), rng.uniform(-0.6, 0.3)
    ahead = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    pose[:3, 3] = place + rng.uniform(-0.1, 0.1, 3)
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    rays = np.stack([(columns - WIDTH / 2) / FOCAL, (rows - HEIGHT / 2) / FOCAL, np.ones(rows.shape)], axis=-1).reshape(
        -1, 3
    )
    length = np.linalg.norm(rays, axis=1)
    directions = rays @ pose[:3, :3].T / length[:, None]
    depth = visible_distance(tree, np.broadcast_to(pose[:3, 3], rays.shape), directions, 10.0)[0] / length
    depth += rng.normal(size=len(depth)) * (DEPTH_NOISE[0] + DEPTH_NOISE[1] * (depth - 0.4) ** 2)
    depth = np.where(depth < REACH, np.round(1000 * depth) / 1000, 0.0)
    pose[:3, :3] = Rotation.from_rotvec(rng.normal(0.0, TURN_NOISE, 3)).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += rng.normal(0.0, POSE_NOISE, 3)
    Image.fromarray((1000 * depth).round().astype(np.uint16).reshape(HEIGHT, WIDTH)).save(
        folder / f"frame-{index:06d}.depth.png"
    )
    np.savetxt(folder / f"frame-{index:06d}.pose.txt", pose)
    some = np.flatnonzero(depth > 0)[::97]
    return (rays * depth[:, None])[some] @ pose[:3, :3].T + pose[:3, 3]


def beside(scan: Path, other: Path) -> dict[str, Any]:
    """Return the distances [m] between the scan of a recording and another mesh of it, both ways, of points within MATCHED."""
    own, there = ply.read(scan / "mesh_aligned_0.05.ply"), ply.read(other)
    matrix = np.array(json.loads((scan / "import.json").read_text())["matrix"])
    moved = there.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    meshes = {"own": Mesh(own.vertices, own.faces), "other": Mesh(moved.astype(np.float32), there.faces)}
    row: dict[str, Any] = {"scan": scan.name, "beside": other.name}
    for name, target in (("own", "other"), ("other", "own")):
        mesh = meshes[target]
        gap = nearest_faces(ray_mesh(mesh.vertices, mesh.faces), sample(meshes[name], SAMPLES, seed=0))[1]
        row |= {f"{name}_faces": len(meshes[name].faces), f"{name}_mean": float(gap[gap < MATCHED].mean())}
        row |= {f"{name}_median": float(np.median(gap)), f"{name}_off": float((gap >= MATCHED).mean())}
    return row


def _recorded_table(rows: list[dict[str, Any]]) -> Table:
    """Return the table of recordings beside their truth."""
    shown = Table("recording of", "frames", "camera mm", "off", "fused mm", "off", "fused / camera")
    for row in rows:
        shown.add_row(
            *(row["scan"], str(row["frames"]), f"{1e3 * row['camera_rms']:.2f}", f"{row['camera_off']:.1%}"),
            *(
                f"{1e3 * row['fused_rms']:.2f}",
                f"{row['fused_off']:.1%}",
                f"{row['fused_rms'] / row['camera_rms']:.2f}",
            ),
        )
    return shown


def _row(f: Figures) -> dict[str, Any]:
    """Return the figures of a scan, with counts instead of those of each handle and object; None: not measured."""
    row = asdict(f) | {"handles": len(f.webs), "webs": _webbed(f)}
    row["seen"] = float(np.median(list(f.seen.values()))) if f.seen else None
    return {name: None if isinstance(value, float) and np.isnan(value) else value for name, value in row.items()}


def _webbed(f: Figures) -> int:
    """Return how many handles have a gap of which half or more is closed."""
    return sum(share >= 0.5 for share in f.webs.values())


def table(all_figures: list[Figures]) -> Table:
    """Return the table of all scans and of what is known of real ones."""
    found = Table(
        "scan", "vertices k", "per m2", "edge mm", "noise mm", "holes/m2", "short", "pieces", "webbed", "seen"
    )
    for f in all_figures:
        found.add_row(
            *(f.scan, f"{f.vertices / 1e3:.0f}", f"{f.density / 1e3:.1f} k", f"{1e3 * f.edge:.1f}"),
            *(f"{1e3 * f.noise:.2f}", f"{f.holes:.1f}", f"{f.short:.0%}", str(f.components)),
            *(f"{_webbed(f)} of {len(f.webs)}", f"{np.median(list(f.seen.values())):.0%}") if f.seen else ("", ""),
        )
    found.add_section()
    for name, *columns, source in REAL:
        found.add_row(name, *columns, source)
    return found


def main() -> None:
    """Print the table; write the figures with --out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", type=Path, nargs="+", metavar="SCAN", help="folder written by `s2a sample`, or PLY")
    parser.add_argument("--out", type=Path, help="JSON file for the figures")
    one = parser.add_mutually_exclusive_group()
    one.add_argument(
        "--recorded", type=int, metavar="FRAMES", help="record the true rooms instead, so many frames each"
    )
    one.add_argument("--beside", type=Path, metavar="MESH", help="compare the only scan with another program's mesh")
    parser.add_argument("--seed", type=int, default=0, help="of recordings")
    args = parser.parse_args()
    if args.beside and len(args.scans) > 1:
        parser.error(f"--beside compares one SCAN, not {len(args.scans)}")
    wp.config.log_level = wp.LOG_WARNING
    if args.beside:
        row = beside(args.scans[0], args.beside)
        if args.out:
            args.out.write_text(json.dumps({**provenance("cpu"), **row}, indent=1) + "\n")
        Console().print(row)
        return
    if args.recorded:
        recordings = [recorded(folder, args.recorded, args.seed) for folder in args.scans]
        if args.out:
            args.out.write_text(json.dumps({**provenance("cpu"), "recordings": recordings}, indent=1) + "\n")
        Console(width=150).print(_recorded_table(recordings))
        return
    figures = [measure(folder) for folder in args.scans]
    if args.out:
        rows = [_row(f) for f in figures]
        args.out.write_text(json.dumps({**provenance("cpu"), "scans": rows}, indent=1) + "\n")
    Console(width=150).print(table(figures))


if __name__ == "__main__":
    main()

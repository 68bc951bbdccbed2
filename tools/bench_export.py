"""Time and peak memory of the export of a scan, beside what trimesh and usd-core alone need for the same mesh.

    python tools/bench_export.py SCAN_FOLDER

Every row runs in a process of its own, so that its peak memory is its own; imports count in the first row only.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import trimesh
from pxr import Usd, UsdGeom, Vt
from rich.console import Console
from rich.table import Table

from s2a import scan
from s2a.core.color_space import to_linear
from s2a.scene.usd import descriptive, geometric

SECONDS, GIGABYTES = 25.0, 4.0
"""What an export may take on two cores."""

Figures = tuple[float, float]
"""Wall time [s] and peak resident memory [GB]."""


def command(folder: Path, out: Path) -> Figures:
    """Run `s2a export`, start and imports included."""
    start = time.perf_counter()
    arguments = [sys.executable, "-m", "s2a", "export", f"scan={folder}", f"out={out}"]
    subprocess.run(arguments, check=True, stdout=subprocess.DEVNULL)
    seconds = time.perf_counter() - start
    return seconds, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6


def read_scan(folder: Path, out: Path) -> float:
    """Read the scan."""
    return _seconds(lambda: scan.read(folder))


def write_descriptive(folder: Path, out: Path) -> float:
    """Write the descriptive flavour."""
    scene = scan.read(folder)
    return _seconds(lambda: descriptive.write(scene, out / "descriptive.usda"))


def write_geometric(folder: Path, out: Path) -> float:
    """Write the geometric flavour as binary."""
    scene = scan.read(folder)
    return _seconds(lambda: geometric.write(scene, out / "geometric.usd"))


def write_geometric_text(folder: Path, out: Path) -> float:
    """Write the geometric flavour as text."""
    scene = scan.read(folder)
    return _seconds(lambda: geometric.write(scene, out / "geometric.usda"))


def read_geometric(folder: Path, out: Path) -> float:
    """Read the binary geometric flavour."""
    return _seconds(lambda: geometric.read(out / "geometric.usd"))


def read_geometric_text(folder: Path, out: Path) -> float:
    """Read the geometric flavour from text."""
    return _seconds(lambda: geometric.read(out / "geometric.usda"))


def trimesh_alone(folder: Path, out: Path) -> float:
    """Read the PLY file, nothing else."""
    return _seconds(lambda: _load(folder))


def usd_alone(folder: Path, out: Path) -> float:
    """Write the whole scan as one Mesh prim, binary."""
    mesh = _load(folder)
    return _seconds(lambda: _write_one_mesh(mesh, out / "alone.usd"))


def usd_alone_text(folder: Path, out: Path) -> float:
    """Write the whole scan as one Mesh prim, text."""
    mesh = _load(folder)
    return _seconds(lambda: _write_one_mesh(mesh, out / "alone.usda"))


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scan", type=Path, help="folder of the scan")
    folder = parser.parse_args().scan
    steps = (
        read_scan, write_descriptive, write_geometric, write_geometric_text, read_geometric, read_geometric_text,
        trimesh_alone, usd_alone, usd_alone_text,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as temporary:
        out = Path(temporary)
        figures = {"s2a export": _apart(command, folder, out / "export")}
        figures |= {step.__name__.replace("_", " "): _apart(_measured, step, folder, out) for step in steps}
        sizes = {path.name: path.stat().st_size / 1e6 for path in sorted(out.glob("*.usd*"))}
    _print(figures, sizes, len(_load(folder).vertices))


def _apart(function: Callable[..., Figures], *arguments: object) -> Figures:
    """Call a function in a fresh process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=context) as pool:
        return pool.submit(function, *arguments).result()


def _measured(step: Callable[[Path, Path], float], folder: Path, out: Path) -> Figures:
    """Return what a step says of its time, and the peak memory of this process."""
    return step(folder, out), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _load(folder: Path) -> trimesh.Trimesh:
    return trimesh.load(next(folder.glob("*.ply")), process=False)


def _write_one_mesh(mesh: trimesh.Trimesh, path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    prim = UsdGeom.Mesh.Define(stage, "/mesh")
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh.vertices.astype("float32")))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh.faces), 3))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.ravel().astype("int32")))
    colors = to_linear(mesh.visual.vertex_colors[:, :3])
    prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(Vt.Vec3fArray.FromNumpy(colors))
    stage.Save()


def _print(figures: dict[str, Figures], sizes: dict[str, float], vertices: int) -> None:
    table = Table(title=f"{vertices:,} vertices")
    for column in ("step", "seconds", "peak GB"):
        table.add_column(column, justify="left" if column == "step" else "right")
    for name, (seconds, gigabytes) in figures.items():
        table.add_row(name, f"{seconds:.2f}", f"{gigabytes:.2f}")
    console = Console()
    console.print(table)
    console.print("sizes [MB]: " + ", ".join(f"{name} {size:.1f}" for name, size in sizes.items()), soft_wrap=True)
    seconds, gigabytes = figures["s2a export"]
    alone = figures["trimesh alone"][0] + figures["usd alone"][0]
    console.print(f"s2a export / (trimesh alone + usd alone) = {seconds / alone:.1f}")
    if seconds > SECONDS or gigabytes > GIGABYTES:
        sys.exit(f"too much: {seconds:.1f} s of {SECONDS:g}, {gigabytes:.2f} GB of {GIGABYTES:g}")


if __name__ == "__main__":
    main()

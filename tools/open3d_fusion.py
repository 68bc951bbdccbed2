"""The mesh that Open3D fuses of a recording of 7-Scenes' layout, for `tools/scan_stats.py SCAN --beside MESH`.

    python -m venv o3d && o3d/bin/pip install open3d
    o3d/bin/python tools/open3d_fusion.py FRAMES OUT.ply

Voxel, truncation and reach are the defaults of `s2a import frames=FRAMES`; depth alone is fused. It needs Open3D, not s2a.
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np

VOXEL, TRUNCATION, FAR, INVALID = 0.01, 4.0, 4.0, 65535  # [m], [voxel], [m]
BLOCKS, MIN_FRAMES = 10_000, 3.0
KINECT = [[585.0, 0.0, 320.0], [0.0, 585.0, 240.0], [0.0, 0.0, 1.0]]
"""The camera of 7-Scenes [pixel], whose own folders hold no camera-intrinsics.txt."""


def main() -> None:
    """Fuse and write the mesh; print processor time and memory."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frames", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    import open3d as o3d  # in an environment of its own, which has no s2a

    begun = time.process_time()
    core = o3d.core
    types = (core.float32, core.float32)
    grid = o3d.t.geometry.VoxelBlockGrid(("tsdf", "weight"), types, ((1), (1)), VOXEL, 16, BLOCKS, core.Device("CPU:0"))
    own = args.frames / "camera-intrinsics.txt"
    camera = core.Tensor(np.loadtxt(own) if own.is_file() else np.array(KINECT))
    for path in sorted(args.frames.glob("frame-*.depth.png")):
        depth = np.array(o3d.io.read_image(str(path)))
        depth[depth == INVALID] = 0
        image = o3d.t.geometry.Image(core.Tensor(depth))
        pose = np.loadtxt(path.with_name(path.name.replace("depth.png", "pose.txt")))
        view = image, camera, core.Tensor(np.linalg.inv(pose)), 1000.0, FAR, TRUNCATION
        grid.integrate(grid.compute_unique_block_coordinates(*view), *view)
    mesh = grid.extract_triangle_mesh(MIN_FRAMES).to_legacy()
    o3d.io.write_triangle_mesh(str(args.out), mesh)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{args.out}: {len(mesh.triangles)} faces, {time.process_time() - begun:.0f} s of processor time, {peak:.0f} MiB"
    )


if __name__ == "__main__":
    main()

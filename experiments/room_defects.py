"""Which defects of a simulation-ready room does the validation report name?

    python experiments/room_defects.py ROOM --slide drawer_15 --hinge door_21 [--defects NAME ...] [--out FILE]

ROOM is a room.usd of `s2a prepare`. Each defect is seeded into a copy of it, for a slide and for a hinge; the rules and the
scanned surface are asked, and physics only where these find nothing. Writes experiments/results/room_defects.json and a table.
A defect that the files cannot tell is marked with the reason.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from pathlib import Path

from defects_of_files import EDITS
from defects_of_rooms import CHANGES
from pxr import Sdf, Usd

from s2a.certify import contents
from s2a.certify.check_suite import CertifyConfig, certify
from s2a.certify.contents import STRUCTURE
from s2a.certify.scan_evidence import Evidence
from s2a.commands.certify import Config
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.scene.usd import sim_stage

RESULTS = Path(__file__).parent / "results/room_defects.json"
UNDECIDABLE = {
    ("origin_10cm_off", "slide"): "no effect on a slide",
    ("grasp_rolled_90", "hinge"): "door_21 has a knob, which can be held any way round",
}
"""Why the file and the scan cannot tell a defect of a kind of joint, where they cannot."""


def seeded(source: Path, folder: Path, name: str, part: str) -> Path:
    """Write a copy of a room with a defect of one of its parts, and return its path."""
    path = folder / "room.usd"
    for old, new in ((source, path), (sim_stage.visuals_file(source), sim_stage.visuals_file(path))):
        shutil.copy(old, new)
    if name in CHANGES:
        sim_stage.write(CHANGES[name](sim_stage.read(source), part), path)
        return path
    # The layer's own visuals keep their name, so that the payloads are found.
    stage = Usd.Stage.Open(str(source))
    layer = Sdf.Layer.CreateNew(str(folder / "edited.usd"))
    layer.TransferContent(stage.GetRootLayer())
    shutil.copy(sim_stage.visuals_file(source), folder / sim_stage.visuals_file(source).name)
    edited = Usd.Stage.Open(layer)
    EDITS[name](edited, part)
    layer.Save()
    return folder / "edited.usd"


def named_by(path: Path, part: str, settings: CertifyConfig, *, physics: bool = True) -> list[str]:
    """Return the checks that fail on a part of a stage; physics is asked only if no other does, and if it is asked at all."""
    held = contents.about(contents.read(path), part)
    checks = [*STRUCTURE.ask(held, settings.shapes, "room"), *STRUCTURE.ask(held, settings.shapes)]
    failed = [check.name for check in checks if check.status == "fail"]
    if failed:
        return failed
    try:
        failed = [c.name for c in Evidence(path).checks(part, settings.evidence) if c.status == "fail"]
    except InputError:
        return ["scan_evidence"]
    return failed or ([c.name for c in certify(path, settings, part)[0].failed] if physics else [])


def main() -> None:
    """Seed each defect into both parts, and write which checks name it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("room", type=Path)
    parser.add_argument("--slide", required=True)
    parser.add_argument("--hinge", required=True)
    parser.add_argument("--defects", nargs="+", default=["none", *CHANGES, *EDITS])
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    settings = config.load(Config, config.compose("certify", ["stage=-", "out=-"])).certify
    rows = []
    for name in args.defects:
        for kind, part in (("slide", args.slide), ("hinge", args.hinge)):
            with tempfile.TemporaryDirectory() as folder:
                path = args.room if name == "none" else seeded(args.room, Path(folder), name, part)
                found = named_by(path, part, settings)
            why = UNDECIDABLE.get((name, kind), "")
            rows.append({"defect": name, "kind": kind, "part": part, "failed": found, "undecidable": why})
            print(f"{name:28}{kind:7}{', '.join(found) or why or 'PASSED'}", flush=True)
    seeded_rows = [row for row in rows if row["defect"] != "none"]
    known = [row for row in seeded_rows if row["failed"] or row["undecidable"]]
    print(
        f"{len([r for r in seeded_rows if r['failed']])} named, {len(known)} named or undecidable, of {len(seeded_rows)}"
    )
    with atomic_write(args.out) as file:
        file.write_text(json.dumps({"room": args.room.name, **provenance("cpu"), "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()

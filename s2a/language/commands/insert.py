"""Command `s2a insert`: insert objects into a room where they belong, as a layer over its stage."""

from s2a.core.errors import CheckFailed, printable
from s2a.language.insert.batch import Insertion, insert_all
from s2a.language.insert.settings import InsertSettings

Config = InsertSettings


def run(config: Config) -> str:
    """Insert the objects and return where they are.

    Raises:
        InputError: nothing could be inserted, or the image file is not PNG; nothing is written.
        CheckFailed: some of several could not; the others are written.
    """
    done = insert_all(config)
    if len(done.inserted) < len(done.records):
        raise CheckFailed(_summary(done, config))
    return _summary(done, config)


def _summary(done: Insertion, config: Config) -> str:
    """Return where the objects are, and why others failed."""
    lines = [f"{done.layer}: {len(done.inserted)} of {len(done.records)} objects over {config.stage}"]
    for record in done.records:
        if record["problem"]:
            lines.append(f"  not {record['label']!r}: {record['problem']}")
            continue
        x, y, z = record["pose"]["position"]
        size = " x ".join(f"{side:.2f}" for side in record["scale"]["size"])
        heeded = record.get("wish", {}).get("heeded", True)
        note = {True: "", False: "; the prompt is not met", None: "; the prompt was not understood, and not checked"}[
            heeded
        ]
        why = "" if config.by_rules else f"; {printable(record['surface']['reason'])[:120]}"
        lines.append(
            f"  {record['id']} on {record['surface']['target']} at ({x:.2f}, {y:.2f}, {z:.2f}), {size} m{note}{why}"
        )
    return "\n".join(lines)

"""Command `s2a zoo`: write a hundred labelled objects to insert, with various units, up axes and formats."""

import json
from dataclasses import dataclass

import numpy as np

from s2a.core.bounds import CountFromZero
from s2a.core.outputs import Output, atomic_write
from s2a.core.progress import track
from s2a.homes.zoo import zoo
from s2a.homes.zoo.download import UNITS, WRITERS, Download, download

# The ground truth, which no user of the objects may read; it identifies a folder as an earlier zoo
TRUTH = "truth.json"


@dataclass(frozen=True)
class Config:
    """Keys of `s2a zoo`.

    Attributes:
        out: folder that receives objects/, list.yaml (object, label and category of each) and truth.json.
        seed: seed of the units, up axes, headings, origins, formats and flaws; the same seed gives the same files.
    """

    out: Output
    seed: CountFromZero


def run(config: Config) -> str:
    """Write the objects, their list and the ground truth; return a summary."""
    deal, dirt = np.random.default_rng(config.seed).spawn(2)
    items = download(zoo(), deal)
    with atomic_write(config.out, earlier=TRUTH) as out:
        (out / "objects").mkdir(parents=True)
        for item in track(items, "objects"):
            WRITERS[item.form][1](out / "objects" / item.file, item.mesh(dirt), UNITS[item.unit], item.up)
        (out / "list.yaml").write_text("".join(map(_entry, items)))
        (out / TRUTH).write_text(
            json.dumps({"seed": config.seed, "objects": dict(map(_truth, items))}, indent=1) + "\n"
        )
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    return f"{config.out}: {len(items)} objects, {size / 1e6:.0f} MB; their true sizes are in {TRUTH}"


def _entry(item: Download) -> str:
    """Return one line of the list; JSON strings are valid YAML."""
    fields = {"object": f"objects/{item.file}", "label": item.object.label, "category": item.object.category}
    return "- {" + ", ".join(f"{key}: {json.dumps(value)}" for key, value in fields.items()) + "}\n"


def _truth(item: Download) -> tuple[str, dict[str, object]]:
    return item.object.slug, {
        "object": f"objects/{item.file}",
        **item.truth(np.ptp(item.object.surface.vertices, axis=0)),
    }

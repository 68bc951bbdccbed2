"""Write the lists of formats in docs/own_scan.md from the list that the tests read: `python tools/format_table.py`."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
BEGIN, END = "<!-- formats: begin -->\n", "<!-- formats: end -->\n"


def main() -> None:
    """Replace the text between the marks."""
    sys.path.insert(0, str(ROOT / "tests" / "support"))
    from mesh_features import FEATURES, table
    from mesh_variants import VARIANTS
    from plain_files import PLAIN_FILES

    page = ROOT / "docs" / "own_scan.md"
    before, _, rest = page.read_text().partition(BEGIN)
    page.write_text(before + BEGIN + table(FEATURES + VARIANTS + PLAIN_FILES) + END + rest.partition(END)[2])


if __name__ == "__main__":
    main()

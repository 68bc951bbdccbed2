"""MkDocs hooks: the site has the repository's own README as its first page, and every file that a page links to.

Links in the repository's Markdown are relative to the file that they are in, so that they work wherever the repository is
read. On the site README.md is `index.md`, what lies in `docs/` lies at the top, and the rest keeps its path.
"""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "CHANGELOG.md", "experiments/README.md")
"""Pages outside of docs/."""
CODE = re.compile(r"```.*?```|~~~.*?~~~|`[^`\n]*`", re.DOTALL)
LINK = re.compile(r"\]\(([^)\s#]*)(#[^)\s]*)?(?: \"[^\"]*\")?\)")
"""Of Markdown: the target's path and its anchor."""


def links(text: str) -> Iterator[tuple[str, str]]:
    """Yield the path and the anchor of every relative link of a Markdown text, code aside."""
    for path, anchor in LINK.findall(CODE.sub("", text)):
        if not re.match(r"[a-z]+:", path):
            yield path, anchor


def place(path: str) -> str:
    """Return where a file of the repository is on the site."""
    return "index.md" if path == "README.md" else path.removeprefix("docs/")


def target(page: str, link: str) -> str:
    """Return the path in the repository of what a page of the repository links to."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(page), link)) if link else page


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages outside of docs/, and what the pages link to."""
    pending = [*PAGES, *(file.src_uri and f"docs/{file.src_uri}" for file in files.documentation_pages())]
    seen = set(pending)
    while pending:
        page = pending.pop()
        if files.get_file_from_path(place(page)) is None:
            files.append(File.generated(config, place(page), abs_src_path=str(ROOT / page)))
        if not page.endswith(".md"):
            continue
        for link, _ in links((ROOT / page).read_text()):
            found = target(page, link)
            if found not in seen and (ROOT / found).is_file():
                seen.add(found)
                pending.append(found)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links between files of the repository into links between files of the site."""
    assert page.file.abs_src_path
    source = os.path.relpath(page.file.abs_src_path, ROOT)
    folder = posixpath.dirname(page.file.src_uri)

    def moved(match: re.Match[str]) -> str:
        link = match[1]
        if not link or re.match(r"[a-z]+:", link):
            return match[0]
        return match[0].replace(link, posixpath.relpath(place(target(source, link)), folder or "."), 1)

    pieces = re.split(f"({CODE.pattern})", markdown, flags=re.DOTALL)
    return "".join(piece if CODE.fullmatch(piece) else LINK.sub(moved, piece) for piece in pieces)

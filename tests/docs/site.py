"""``python -m tests.docs.site``: build the documentation as a site in build/site, by Sphinx.

Pages outside docs/ become pages of the site. Links to source code become plain text. The notebook
is executed. A link that leads nowhere, or a cell that fails, ends the build.
"""

from __future__ import annotations

import posixpath
import re
import shutil
import subprocess
import sys
from pathlib import Path

from tests.paths import ROOT

BUILD = ROOT / "build"
SITE, SOURCES = BUILD / "site", BUILD / "site-sources"
OUTSIDE = {
    "README.md": "overview.md",
    "CONTRIBUTING.md": "contributing.md",
    "drivers/firmware/README.md": "firmware.md",
}
"""Page outside docs/ → its page in the site"""
LINK = re.compile(r"\[([^\]]+)\]\(([^)#\s]+)(#[^)\s]*)?\)")
SECTIONS = ("tutorials", "how-to", "troubleshooting", "explanation", "reference", "results")
CONFIGURATION = """
project = "heli3dof"
author = "the heli3dof authors"
extensions = ["myst_nb"]
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
html_theme = "furo"
html_title = "heli3dof"
html_show_copyright = False
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
suppress_warnings = ["misc.highlighting_failure"]
"""


def build() -> None:
    """Write build/site. Raises CalledProcessError if Sphinx warns."""
    for folder in (SITE, SOURCES):
        shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "docs", SOURCES)
    for source, page in OUTSIDE.items():
        shutil.copy(ROOT / source, SOURCES / page)
    (SOURCES / "README.md").rename(SOURCES / "index.md")
    for path in SOURCES.rglob("*.md"):
        page = path.relative_to(SOURCES).as_posix()
        path.write_text(in_site(path.read_text(encoding="utf-8"), page), encoding="utf-8")
    with (SOURCES / "index.md").open("a", encoding="utf-8") as index:
        index.write(contents())
    (SOURCES / "conf.py").write_text(CONFIGURATION, encoding="utf-8")
    subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", SOURCES, SITE], check=True
    )


def contents() -> str:
    """Return the site's tables of contents, a hidden one for each folder of docs/."""
    lists = []
    for section in SECTIONS:
        folder = ROOT / "docs" / section
        pages = sorted(p.stem for p in [*folder.glob("*.md"), *folder.glob("*.ipynb")])
        names = "\n".join(f"{section}/{page}" for page in pages)
        caption = section.replace("-", " ").capitalize()
        lists.append(f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{names}\n```\n")
    more = "\n".join(Path(page).stem for page in OUTSIDE.values())
    return "".join([*lists, f"\n```{{toctree}}\n:hidden:\n:caption: More\n\n{more}\n```\n"])


def in_site(text: str, page: str) -> str:
    """Return a page's text with its links as they are in the site.

    >>> in_site("[plans](docs/reference/plans.md#rich), [code](drivers/mock.py)", "overview.md")
    '[plans](reference/plans.md#rich), code'
    """
    outside = {name: source for source, name in OUTSIDE.items()}
    home = posixpath.dirname(outside.get(page, "docs/" + page))
    here = posixpath.dirname(page)

    def link(match: re.Match[str]) -> str:
        if "://" in match[2]:
            return match[0]
        path = posixpath.normpath(posixpath.join(home, match[2]))
        target = OUTSIDE.get(path) or path.removeprefix("docs/")
        if target == "README.md":
            target = "index.md"
        if path not in OUTSIDE and not path.startswith("docs/"):
            return match[1]
        return f"[{match[1]}]({posixpath.relpath(target, here or '.')}{match[3] or ''})"

    return LINK.sub(link, text)


if __name__ == "__main__":
    build()
    print(f"Written: {SITE.relative_to(ROOT)}/index.html")

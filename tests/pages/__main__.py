"""``python -m tests.pages``: rewrite the computed blocks of the documentation."""

from __future__ import annotations

from tests.pages.pages import PAGES

for page in PAGES:
    print(page.file, "rewritten" if page.rewrite() else "unchanged")

"""Links of the documentation: every file and every heading that a page links to is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.docs_pages import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
LINK = re.compile(r"\]\(([^)\s]+)\)")
BLOCK = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Of its headings: in lower case, with hyphens for spaces and without punctuation."""
    headings = re.findall(r"^#+ (.+)$", BLOCK.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings}


def dead_links(page: Path) -> list[str]:
    """The links of a page, but those to the web, that lead nowhere."""
    links = LINK.findall(BLOCK.sub("", page.read_text(encoding="utf-8")))
    return [link for link in links if "://" not in link and not leads_somewhere(page, link)]


def leads_somewhere(page: Path, link: str) -> bool:
    name, _, anchor = link.partition("#")
    target = page if not name else (page.parent / name).resolve()
    return target.exists() and (not anchor or anchor in anchors(target))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page: Path) -> None:
    assert dead_links(page) == []


def test_dead_links_are_found(tmp_path: Path) -> None:
    page, other = tmp_path / "page.md", tmp_path / "other.md"
    other.write_text("# A heading, it is\n")
    page.write_text(
        "# Here\n[a](other.md#a-heading-it-is) [b](#here) [c](other.md#gone) [d](no.md) [e](#no)\n"
        "```\n# no heading\n[f](no-link.md)\n```\n"
    )
    assert dead_links(page) == ["other.md#gone", "no.md", "#no"]

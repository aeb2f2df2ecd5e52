"""Pages that say how to add a device: each file and each name that they quote is there."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from config.app import AppConfig
from config.loader import Section
from tests.support.docs_pages import ROOT, Page

PAGES = [Page("docs/add-a-chassis.md"), Page("docs/add-a-camera.md")]
SECTIONS = ("robot", "perception", "decision")


def quoted(pattern: str) -> list[str]:
    return sorted({name for page in PAGES for name in page.names(pattern)})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_page_was_read(page: Page) -> None:
    assert len(page.quoted) > 30
    assert page.every_block_names_its_file()


@pytest.mark.parametrize("path", quoted(r"[\w./-]+\.(py|yaml|toml)"))
def test_every_file_they_name_is_there(path: str) -> None:
    assert (ROOT / path).is_file()


@pytest.mark.parametrize("name", quoted(r"(config|controller|hal|sim|vision)(\.\w+)+"))
def test_every_name_they_name_can_be_imported(name: str) -> None:
    module, _, attribute = name.rpartition(".")
    assert hasattr(importlib.import_module(module), attribute)


@pytest.mark.parametrize("key", quoted(rf"({'|'.join(SECTIONS)})(\.\w+)+"))
def test_every_key_they_name_is_one(key: str) -> None:
    section: object = AppConfig
    for name in key.split("."):
        assert isinstance(section, type)
        assert issubclass(section, Section)
        section = section.model_fields[name].annotation


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
@pytest.mark.parametrize("from_file", ["README.md", "CONTRIBUTING.md", "docs/design.md"])
def test_page_is_linked_where_readers_look_for_it(page: Page, from_file: str) -> None:
    assert page.name.removeprefix("docs/") in (ROOT / from_file).read_text()


@pytest.mark.parametrize("page", sorted((ROOT / "docs/decisions").glob("*.md")), ids=lambda page: page.name)
def test_the_design_lists_every_decision(page: Path) -> None:
    """By its anchor: the heading in lower case, with hyphens for spaces and without punctuation."""
    text = (ROOT / "docs/design.md").read_text()
    headings = re.findall(r"^## (.+)$", page.read_text(), re.MULTILINE)
    assert headings
    anchors = [re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings]
    assert [one for one in anchors if f"(decisions/{page.name}#{one})" not in text] == []

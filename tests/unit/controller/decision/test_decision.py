"""The names that observations carry, against the page that explains them."""

import re
from pathlib import Path
from typing import get_args

from controller.decision.decision import Rule

DESIGN = Path(__file__).resolve().parents[4] / "docs" / "design.md"


def test_every_rule_is_explained_and_nothing_else() -> None:
    table = DESIGN.read_text().partition("| rule | what limits the speed |")[2].partition("\n\n")[0]
    cells = re.findall(r"^\| ([a-z, ]+) \|", table, re.MULTILINE)
    explained = [name.strip() for cell in cells for name in cell.split(",")]
    assert sorted(explained) == sorted(get_args(Rule))

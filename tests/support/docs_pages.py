"""A page of docs/ whose blocks of code each name their file: what is pasted from it where it says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from config.loader import CONFIG_DIR

ROOT = CONFIG_DIR.parent
PACKAGES = ("config", "controller", "hal", "sim", "vision")
# What is compiled (hal/compiled.py) is copied, too: it is of the text, and making it anew takes minutes. Not
# what is just being written.
IGNORED = shutil.ignore_patterns("*.pyc", "*.tmp.*")


class Page:
    """files, changes: (file, text) of each block: whole files, and lines that go into one."""

    def __init__(self, name: str) -> None:
        """name: of the page, relative to the project."""
        self.name = name
        self.text = (ROOT / name).read_text(encoding="utf-8")
        self.files: list[tuple[str, str]] = self._blocks("python")
        self.changes: list[tuple[str, str]] = self._blocks("diff")
        self.quoted: list[str] = re.findall(r"`([^`\n]+)`", self.text)

    def _blocks(self, language: str) -> list[tuple[str, str]]:
        block = rf"^```{language}\n# (\S+)\n(.*?)^```$"
        return re.findall(block, self.text, re.MULTILINE | re.DOTALL)

    def every_block_names_its_file(self) -> bool:
        return self.text.count("```") == 2 * (len(self.files) + len(self.changes))

    def names(self, pattern: str) -> list[str]:
        """What it quotes of this pattern, sorted, each once."""
        return sorted({word for word in self.quoted if re.fullmatch(pattern, word)})

    def paste(self, project: Path, folders: tuple[str, ...] = PACKAGES) -> None:
        """A copy of these folders into project, with all that the page says in it."""
        for folder in folders:
            shutil.copytree(ROOT / folder, project / folder, ignore=IGNORED)
        shutil.copy(ROOT / "pyproject.toml", project)
        for name, text in self.files:
            assert not (project / name).exists(), name
            (project / name).write_text(text, encoding="utf-8")
        for name, change in self.changes:
            path = project / name
            location = f"{self.name}: {name}"
            path.write_text(changed(path.read_text(encoding="utf-8"), change, location), encoding="utf-8")
        _sort_imports(project, [name for name, _ in self.changes])


def changed(text: str, change: str, location: str) -> str:
    """text with the lines of a change: + comes in, - goes, and the others are found in this order.

    Raises LookupError for a line that is not in text; where: the page and the file, to say so.
    """
    lines, position = text.splitlines(), 0

    def find(line: str, start: int) -> int:
        try:
            return lines.index(line, start)
        except ValueError:
            raise LookupError(
                f"{location}: this line has changed, change it on the page too: {line}"
            ) from None

    for index, line in enumerate(change.splitlines()):
        mark, content = line[:1], line[1:]
        if mark == "+":
            if index == 0:
                # What comes before the first line that is found goes right before it.
                first = next(line[1:] for line in change.splitlines() if line[:1] in "- ")
                position = find(first, 0)
            lines.insert(position, content)
            position += 1
            continue
        position = find(content, position)
        if mark == "-":
            del lines[position]
        else:
            position += 1
    return "\n".join(lines) + "\n"


def _sort_imports(project: Path, names: list[str]) -> None:
    """A page says below which import its own goes, and whoever has added a kind may have one between them."""
    result = python_in(project, "-m", "ruff", "check", "--no-cache", "--select", "I", "--fix", *names)
    assert result.returncode == 0, result.stdout + result.stderr


def python_in(project: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """python -P of these arguments in a pasted project, whose packages are the ones that load."""
    return subprocess.run(
        [sys.executable, "-P", *arguments],
        cwd=project,
        env={**os.environ, "PYTHONPATH": str(project)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def ruff_findings(project: Path) -> str:
    """What ruff says about the code and the format of a pasted project; nothing if all is well."""
    checks = [("check", "--no-cache", "."), ("format", "--no-cache", "--check", ".")]
    results = [python_in(project, "-m", "ruff", *check) for check in checks]
    return "".join(result.stdout + result.stderr for result in results if result.returncode != 0)

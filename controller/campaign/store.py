"""missions.jsonl: one row for each mission and policy, appended when it is done, so that a campaign can be
resumed."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from controller.campaign.judge import Row
from controller.errors import UserError
from controller.terminal.outlet import say

MISSIONS = "missions.jsonl"
SETTINGS = "config.json"
Key = tuple[str, int, str]


def row_key(row: Row) -> Key:
    """The key that identifies a row within a report."""
    return row.family, row.seed, row.policy


class MissionStore:
    """The rows of a report folder and their file, and next to it the configuration of the drives.

    settings: the configuration as text.
    """

    def __init__(self, folder: Path, settings: str) -> None:
        self.path = folder / MISSIONS
        self.rows: dict[Key, Row] = {}
        self._settings = settings
        self._settings_path = folder / SETTINGS

    def begin(self, resume: bool) -> None:
        """Create the folder; if resumed, keep the rows of the earlier campaign. Raises UserError."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.path.exists() and not resume:
                raise UserError(
                    f"{self.path} exists: add --resume to go on with it, or give another --report folder"
                )
            if resume and not self.path.exists():
                say(
                    f"treadwatch: warning: {self.path}: no such file, so --resume has nothing to go on "
                    "with; a new campaign begins",
                    to_stderr=True,
                )
            elif resume:
                self._check_settings()
                self._read()
                self.rewrite()
            # Find out now whether files can be written, not when the first mission is over.
            temporary = self.path.with_suffix(".part")
            temporary.touch()
            temporary.unlink()
        except OSError as error:
            raise UserError(f"{self.path}: {error.strerror}; choose a folder that can be written") from error

    def add(self, rows: Iterable[Row]) -> None:
        """Append rows. A line that is incomplete, because the machine stopped, is dropped on resuming.

        Raises UserError.
        """
        with self._reporting_errors():
            if not self.path.exists():
                self._settings_path.write_text(self._settings, encoding="utf-8")
            with self.path.open("a", encoding="utf-8") as file:
                for row in rows:
                    self.rows[row_key(row)] = row
                    file.write(json.dumps(row.as_dict()) + "\n")

    def rewrite(self) -> None:
        """Write all rows in a fixed order, independent of the order of the workers. Raises UserError."""
        self.rows = dict(sorted(self.rows.items()))
        text = "".join(json.dumps(row.as_dict()) + "\n" for row in self.rows.values())
        temporary = self.path.with_suffix(".part")
        with self._reporting_errors():
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(self.path)

    @contextmanager
    def _reporting_errors(self) -> Iterator[None]:
        """Turn an OSError, such as a full disk, into a UserError; the rows so far are not lost."""
        try:
            yield
        except OSError as error:
            raise UserError(
                f"{self.path}: nothing more can be written ({error.strerror}); make room, then the same "
                "command with --resume goes on"
            ) from error

    def _check_settings(self) -> None:
        """Raise UserError if the earlier rows were driven with another configuration."""
        if self._settings_path.exists() and _read_text(self._settings_path) != self._settings:
            raise UserError(
                f"{self.path}: was driven with another --config (it is in {self._settings_path}); go on with "
                "that one, or give another --report folder"
            )

    def _read(self) -> None:
        text = _read_text(self.path)
        lines, truncated = text.splitlines(), not text.endswith("\n")
        for number, line in enumerate(lines, start=1):
            try:
                row = parse_row(json.loads(line))
            except (ValueError, TypeError, KeyError) as error:
                if truncated and number == len(lines):
                    return
                raise UserError(
                    f"{self.path}: line {number} is not a row of this program ({error}); "
                    "mend it or give another --report folder"
                ) from error
            self.rows[row_key(row)] = row


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise UserError(
            f"{path}: is no text in UTF-8 ({error.reason} at byte {error.start}); mend it or give another "
            "--report folder"
        ) from error


def parse_row(values: dict[str, object]) -> Row:
    """A row from its JSON object. Raises TypeError if it is not a row."""
    if not isinstance(values, dict):
        raise TypeError("no object")
    lists: dict[str, object] = {}
    for key in ("touched", "touched_not_at_fault", "touched_at_mps"):
        if key in values:
            content = values[key]
            if not isinstance(content, list):
                raise TypeError(f"{key} is no list")
            lists[key] = tuple(content)
    if "min_clearance_m" in values and values["min_clearance_m"] is None:
        values = {**values, "min_clearance_m": math.inf}
    return Row(**(values | lists))  # type: ignore[arg-type]  # Row has the last word

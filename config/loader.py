"""YAML files to frozen models. The mistakes of a file are reported together: file, key, reason."""

from __future__ import annotations

import math
import os.path
from datetime import date
from pathlib import Path
from typing import TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from config.known_keys import advice, whose, written

CONFIG_DIR = Path(__file__).resolve().parent
# How many mistakes are listed: a file with more is another kind of file, and the line must stay readable.
_MOST_MISTAKES = 8
# With at least this many unknown sections, and fewer known ones, the file is of another kind.
_ANOTHER_KIND = 3
# Replacements for messages in which pydantic speaks of itself instead of the file.
_IN_OTHER_WORDS = {
    "union_tag_not_found": "its key kind is missing",
    "union_tag_invalid": "its {discriminator} is {tag!r}, which is none of {expected_tags}",
    "tuple_type": "Input should be a list",
    "model_type": "Input should be keys and values",
    "model_attributes_type": "Input should be keys and values",
    "too_short": "the list must hold at least {min_length}, found {actual_length}",
    "too_long": "the list must hold at most {max_length}, found {actual_length}",
    "invalid_key": "a key must be a word; a decimal has a point, not a comma",
}
# Errors of a number outside its bounds, and units by the ending of a key: a wrong unit is the usual cause.
_BOUNDS = frozenset({"less_than", "less_than_equal", "greater_than", "greater_than_equal"})
_UNITS = {
    "m": "m",
    "s": "s",
    "ms": "ms",
    "px": "pixels",
    "deg": "degrees",
    "rad": "rad",
    "hz": "Hz",
    "v": "V",
    "mps": "m/s",
    "mps2": "m/s^2",
    "mps3": "m/s^3",
    "radps": "rad/s",
    "degps": "degrees/s",
}


class ConfigError(Exception):
    """A YAML file is missing, is not YAML, or says something unknown, wrong or impossible."""


class Section(BaseModel):
    """Base of every part of the configuration: strict types, no unknown keys, no NaN, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


SectionT = TypeVar("SectionT", bound=Section)

_MERGE = "tag:yaml.org,2002:merge"
# What PyYAML raises, without naming the place, for a scalar that its tag does not allow: day 32, 5000 digits.
_NOT_WHAT_IT_SAYS = (ValueError, LookupError, AttributeError, TypeError, OverflowError)


class _UniqueKeyLoader(yaml.SafeLoader):
    """SafeLoader that refuses a key given twice, of which the second would silently win. A merged key (<<)
    may be given again: that is the purpose of merging."""

    def construct_mapping(self, node: yaml.Node, deep: bool = False) -> dict[object, object]:
        if not isinstance(node, yaml.MappingNode):
            raise _wrong(node, "expected keys and values")  # as in `!!set [a]`
        seen: set[object] = set()
        for key_node, _ in node.value:
            if key_node.tag == _MERGE:
                continue
            if not isinstance(key_node, yaml.ScalarNode):
                raise _wrong(key_node, "a key must be a word, not a list or other keys")
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise _wrong(key_node, f"key {key!r} is given twice")
            seen.add(key)
        return super().construct_mapping(node, deep)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> object:
        try:
            return super().construct_object(node, deep)
        except _NOT_WHAT_IT_SAYS as error:
            kind = node.tag.rpartition(":")[2]
            raise _wrong(node, f"{str(node.value)[:40]!r} is no {kind}; put text in quotes") from error


def _wrong(node: yaml.Node, problem: str) -> yaml.constructor.ConstructorError:
    return yaml.constructor.ConstructorError(None, None, problem, node.start_mark)


def read_yaml(path: Path) -> object:
    """The plain content of a YAML file. Raises ConfigError in one line."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text ({error.reason}); is it a YAML file?") from error
    except ValueError as error:  # a NUL in the name
        raise ConfigError(f"{path}: cannot be read ({error}); check the path") from error
    try:
        return yaml.load(text, Loader=_UniqueKeyLoader)
    except RecursionError as error:
        raise ConfigError(f"{path}: is nested too deeply to be a configuration") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: is not valid YAML: {_yaml_mistake(error)}") from error


def load(path: Path, model: type[SectionT]) -> SectionT:
    """Read path as model. Raises ConfigError with one line naming each wrong key and why."""
    content = read_yaml(path)
    if content is None:
        raise ConfigError(f"{path}: is empty; it must hold keys and values")
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: must hold keys and values, found {type(content).__name__}")
    unknown = [str(key) for key in content if key not in model.model_fields]
    if len(unknown) >= _ANOTHER_KIND and 2 * len(unknown) > len(content):
        raise ConfigError(
            f"{path}: is another kind of file: {', '.join(unknown[:_MOST_MISTAKES])} mean nothing here; "
            f"known are {', '.join(sorted(model.model_fields))}"
        )
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigError(f"{path}: {describe(error, model, content)}") from error


def _yaml_mistake(error: yaml.YAMLError) -> str:
    """The place and the reason; what PyYAML itself writes names the place twice and quotes the lines."""
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem is None:
        return " ".join(str(error).split())
    mark = error.problem_mark or error.context_mark
    where = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: "
    advice = "; indent with spaces, not with tabs" if "'\\t'" in error.problem else ""
    return f"{where}{error.problem}" + (f" ({error.context})" if error.context else "") + advice


def describe(error: ValidationError, model: type[BaseModel], content: object = None) -> str:
    """The mistakes of a validation in one line: ``key: reason; key: reason``.

    content: what was validated, to name items of lists: ``bodies.7.height_m (crate 'by the door'): reason``.
    """
    parts = []
    told: set[str] = set()
    details = error.errors(include_url=False)
    for detail in details:
        if detail["type"] == "default_factory_not_called":
            continue  # a default that depends on a wrong key, which has its own error
        if detail["type"] == "too_short" and any(_is_in(one, detail) for one in details):
            continue  # wrong items are not counted, and have their own errors
        unknown = detail["type"] == "extra_forbidden"
        key = written(model, detail["loc"], last_is_key=unknown)
        item = whose(content, detail["loc"])
        if key and item:
            key += f" ({item})"
        reason = _reason(detail, key)
        if unknown:
            hint = advice(model, detail["loc"])
            # Several unknown keys of one section: list the known ones only once.
            reason = "unknown key" if hint in told else f"unknown key; {hint}"
            told.add(hint)
        parts.append(f"{key}: {reason}" if key else reason)
    if len(parts) > _MOST_MISTAKES:
        parts[_MOST_MISTAKES:] = [f"and {len(parts) - _MOST_MISTAKES} more mistakes"]
    return "; ".join(parts)


def _reason(detail: ErrorDetails, key: str) -> str:
    """What is wrong with the value of key, and what was found."""
    kind, context, found = detail["type"], detail.get("ctx", {}), detail["input"]
    reason = detail["msg"].removeprefix("Value error, ")
    if kind == "missing":
        return "missing key"
    if kind in _IN_OTHER_WORDS:
        reason = _IN_OTHER_WORDS[kind].format(**context)
    if isinstance(found, dict | list):
        return reason
    shown = str(found) if isinstance(found, date) else repr(found)
    reason = f"{reason}, found {shown}{_what_to_write(detail)}"
    unit = _unit_of(key) if kind in _BOUNDS else ""
    return f"{reason} {unit}" if unit else reason


def _is_in(inner: ErrorDetails, outer: ErrorDetails) -> bool:
    """Whether inner is a mistake in a part of what outer is about."""
    place = outer["loc"]
    return len(inner["loc"]) > len(place) and inner["loc"][: len(place)] == place


def _unit_of(key: str) -> str:
    """The unit that the name of a key ends with, in words; "" if there is none."""
    return _UNITS.get(key.partition(" ")[0].rpartition("_")[2], "")


def _what_to_write(detail: ErrorDetails) -> str:
    """What to write in place of a value of the wrong type, or "".

    YAML 1.1 reads `15e-1` and '"1.5"' as text, a serial number as a number, and 2024-01-02 as a date.
    """
    if detail["type"] == "string_type" and isinstance(detail["input"], int | float | date):
        return f", which is no text: put it in quotes, '{detail['input']}'"
    if detail["type"] not in ("float_type", "int_type") or not isinstance(detail["input"], str):
        return ""
    try:
        number = float(detail["input"])
    except ValueError:
        return ""
    return f", which is text: write {number:g}" if math.isfinite(number) else ""


def resolve(path: str, relative_to: Path) -> Path:
    """The path of a file named in a YAML: absolute, beside that YAML, or among the files that ship here."""
    given = Path(path).expanduser()
    if given.is_absolute():
        return given
    beside = relative_to.parent / given
    shipped = CONFIG_DIR / given
    # os.path, not Path.exists(), which raises for a name that is too long or a folder without permission.
    return shipped if os.path.exists(shipped) and not os.path.exists(beside) else beside

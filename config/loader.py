"""YAML files to frozen models. The mistakes of a file are reported together: file, key, reason."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from config.known_keys import advice, written

CONFIG_DIR = Path(__file__).resolve().parent
# A file with more mistakes than this is another kind of file, and one line is for reading.
_MOST_MISTAKES = 8


class ConfigError(Exception):
    """A YAML file is missing, is not YAML, or says something unknown, wrong or impossible."""


class Section(BaseModel):
    """Base of every part of the configuration: strict types, no unknown keys, no NaN, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


SectionT = TypeVar("SectionT", bound=Section)


class _UniqueKeyLoader(yaml.SafeLoader):
    """SafeLoader that refuses a key given twice: the second would silently win."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[object, object]:
        seen: set[object] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {key!r} is given twice", key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep)


def read_yaml(path: Path) -> object:
    """The plain content of a YAML file. Raises ConfigError in one line."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text ({error.reason}); is it a YAML file?") from error
    try:
        return yaml.load(text, Loader=_UniqueKeyLoader)
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: is not valid YAML: {_yaml_mistake(error)}") from error


def load(path: Path, model: type[SectionT]) -> SectionT:
    """Read path as model. Raises ConfigError with one line naming each wrong key and why."""
    content = read_yaml(path)
    if content is None:
        raise ConfigError(f"{path}: is empty; it must hold keys and values")
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: must hold keys and values, found {type(content).__name__}")
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigError(f"{path}: {describe(error, model)}") from error


def _yaml_mistake(error: yaml.YAMLError) -> str:
    """The place and the reason; what PyYAML itself writes names the place twice and quotes the lines."""
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem is None:
        return " ".join(str(error).split())
    mark = error.problem_mark or error.context_mark
    where = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: "
    return f"{where}{error.problem}" + (f" ({error.context})" if error.context else "")


def describe(error: ValidationError, model: type[BaseModel]) -> str:
    """The mistakes of a validation in one line: ``key: reason; key: reason``."""
    parts = []
    told: set[str] = set()
    for detail in error.errors(include_url=False):
        if detail["type"] == "default_factory_not_called":
            continue  # a default that follows from a key that is wrong itself
        unknown = detail["type"] == "extra_forbidden"
        key = written(model, detail["loc"], last_is_key=unknown)
        reason = detail["msg"].removeprefix("Value error, ")
        if unknown:
            hint = advice(model, detail["loc"])
            # Several keys of another kind of file: what is known is said once.
            reason = "unknown key" if hint in told else f"unknown key; {hint}"
            told.add(hint)
        elif detail["type"] == "missing":
            reason = "missing key"
        elif not isinstance(detail["input"], dict | list):
            reason = f"{reason}, found {detail['input']!r}"
        parts.append(f"{key}: {reason}" if key else reason)
    if len(parts) > _MOST_MISTAKES:
        parts[_MOST_MISTAKES:] = [f"and {len(parts) - _MOST_MISTAKES} more mistakes"]
    return "; ".join(parts)


def resolve(path: str, relative_to: Path) -> Path:
    """A file named in a YAML: absolute, beside that YAML, or among the files that ship here."""
    given = Path(path).expanduser()
    if given.is_absolute():
        return given
    beside = relative_to.parent / given
    return beside if beside.exists() else CONFIG_DIR / given

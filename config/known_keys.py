"""Help for mistakes in a YAML file: the place of a mistake as it stands in the file, and the keys that are
known there. config/loader.py puts both into its messages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import get_args

from pydantic import BaseModel

_LONGEST_NAME = 40


def advice(model: type[BaseModel], place: Sequence[int | str]) -> str:
    """What to write in place of the unknown key at place, pydantic's path to it within model."""
    *steps, key = place
    known = sorted(_known_at(model, steps))
    close = get_close_matches(str(key), known, n=1)
    return f"did you mean {close[0]}?" if close else f"known here: {', '.join(known)}"


def written(model: type[BaseModel], place: Sequence[int | str], *, last_is_key: bool) -> str:
    """place as keys joined by dots, as in the file: without the tags of unions, which pydantic inserts.

    last_is_key: the last step is a key from the file, known or not.
    """
    sections, keys = {model}, []
    for number, step in enumerate(place, start=1):
        known = isinstance(step, int) or any(step in section.model_fields for section in sections)
        if known or (last_is_key and number == len(place)):
            keys.append(str(step))
        sections = _within(sections, step)
    return ".".join(keys)


def whose(content: object, place: Sequence[int | str]) -> str:
    """The item of a list that place lies in, by its kind and name in the file; "" if it needs no name.

    content: of the whole file. Steps that are not in it are tags of unions, which pydantic inserts.
    """
    for step in place:
        if isinstance(content, list) and isinstance(step, int) and step < len(content):
            return _item_in_words(content[step], nameless=place[-1] == "name")
        if isinstance(content, dict) and step in content:
            content = content[step]
    return ""


def _item_in_words(item: object, nameless: bool) -> str:
    if not isinstance(item, dict) or ("name" not in item and not nameless):
        return ""
    kind, name = item.get("kind"), item.get("name")
    words = [kind[:_LONGEST_NAME]] if isinstance(kind, str) else []
    if isinstance(name, str):
        words.append(repr(name[:_LONGEST_NAME]))
    return " ".join(words)


def _known_at(model: type[BaseModel], steps: Sequence[int | str]) -> set[str]:
    sections = {model}
    for step in steps:
        sections = _within(sections, step)
    return {key for section in sections for key in section.model_fields}


def _within(sections: set[type[BaseModel]], step: int | str) -> set[type[BaseModel]]:
    """The sections that one step leads to. An index in a list is not a key, nor is the tag of a union, which
    is the value of `kind`."""
    inner = {
        found
        for section in sections
        if (field := section.model_fields.get(str(step))) is not None
        for found in _sections_in(field.annotation)
    }
    tagged = {section for section in sections if _is_tagged(section, step)}
    return inner or tagged or sections


def _sections_in(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _sections_in(part)


def _is_tagged(section: type[BaseModel], tag: int | str) -> bool:
    kind = section.model_fields.get("kind")
    return kind is not None and tag in get_args(kind.annotation)

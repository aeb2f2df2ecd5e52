"""Which key was meant: the keys that a section knows, for messages about one that it does not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import get_args

from pydantic import BaseModel


def advice(model: type[BaseModel], place: Sequence[int | str]) -> str:
    """What to write in place of the unknown key at place, pydantic's path to it within model."""
    *steps, key = place
    known = sorted(_known_at(model, steps))
    close = get_close_matches(str(key), known, n=1)
    return f"did you mean {close[0]}?" if close else f"known here: {', '.join(known)}"


def _known_at(model: type[BaseModel], steps: Sequence[int | str]) -> set[str]:
    sections = {model}
    for step in steps:
        inner = {
            found
            for section in sections
            if (field := section.model_fields.get(str(step))) is not None
            for found in _sections_in(field.annotation)
        }
        # Neither the place in a list nor the tag of a union is a key; the tag is what `kind` says.
        tagged = {section for section in sections if _is_tagged(section, step)}
        sections = inner or tagged or sections
    return {key for section in sections for key in section.model_fields}


def _sections_in(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _sections_in(part)


def _is_tagged(section: type[BaseModel], tag: int | str) -> bool:
    kind = section.model_fields.get("kind")
    return kind is not None and tag in get_args(kind.annotation)

"""Messages for users: notes on a result and checks of a manifest, from ``messages.toml``."""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple


class Note(NamedTuple):
    """A message that a reader should know before trusting a result."""

    code: str  #: Its name, under which the book explains it
    text: str  #: One line


@dataclass(frozen=True)
class Message:
    """A message of ``messages.toml``."""

    text: str
    remedy: str
    meaning: str = ""
    #: Limit that a note or a check of the manifest compares with, and a check's unit
    limit: float = float("nan")
    unit: str = ""
    #: Other texts of the same message, by name
    variants: Mapping[str, str] = field(default_factory=dict)

    @property
    def pattern(self) -> str:
        """Return the text with ellipses in place of values."""
        return re.sub(r"\{[^}]*\}", "…", self.text)


def _read_messages(table: Mapping[str, Any]) -> dict[str, Message]:
    """Return the messages of a table by code, with line breaks as blanks."""
    messages = {}
    for code, fields in table.items():
        plain = {k: " ".join(v.split()) if isinstance(v, str) else v for k, v in fields.items()}
        variants = {k.removeprefix("text_"): v for k, v in plain.items() if k.startswith("text_")}
        own: dict[str, Any] = {k: v for k, v in plain.items() if not k.startswith("text_")}
        messages[code] = Message(**own, variants=variants)
    return messages


_MESSAGES_FILE = Path(__file__).with_name("messages.toml")
_MESSAGE_TABLES = tomllib.loads(_MESSAGES_FILE.read_text(encoding="utf-8"))
#: Notes on a result and checks of a manifest, by subject, then by code
NOTE_GROUPS = {name: _read_messages(group) for name, group in _MESSAGE_TABLES["notes"].items()}
CHECK_GROUPS = {name: _read_messages(group) for name, group in _MESSAGE_TABLES["checks"].items()}
#: Unknowns of a check, and lines of ``thesis measure --new``
UNCHECKED_MESSAGES = _read_messages(_MESSAGE_TABLES["unchecked"])
NEW_MESSAGES = _read_messages(_MESSAGE_TABLES["new"])
#: Notes and checks by code
ALL_MESSAGES = {
    code: one
    for group in (*NOTE_GROUPS.values(), *CHECK_GROUPS.values())
    for code, one in group.items()
}
NOTE_LIMITS = {code: one.limit for group in NOTE_GROUPS.values() for code, one in group.items()}
CHECK_LIMITS = {code: one.limit for group in CHECK_GROUPS.values() for code, one in group.items()}


def make_note(code: str, variant: str = "", /, **values: object) -> Note:
    """Return a note with its values filled in."""
    return Note(code, format_message(ALL_MESSAGES[code], variant, **values))


def format_message(message: Message, variant: str = "", /, **values: object) -> str:
    """Return the text of a message, or of one of its variants, with values filled in."""
    text = message.variants[variant] if variant else message.text
    return text.format(limit=message.limit, **values)


def template_line(code: str, **values: object) -> str:
    """Return a line of ``thesis measure --new``: the text, then its variant ``rest``, if any."""
    message = NEW_MESSAGES[code]
    return (message.text + message.variants.get("rest", "")).format(**values)

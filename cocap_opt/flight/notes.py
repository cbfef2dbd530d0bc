"""Notes on flights and their files: a sentence each, with a kind by which they are selected."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, auto


class Kind(Enum):
    """The purpose of a note.

    URGENT : nobody must overlook it
    CREW : the crew must know it, and a sheet has it in its own words
    UNCHECKED : was not checked, or is unknown
    NO_RULE : likewise, of a distance that no rule asks for; a short answer has it beside its value
    READING : how to read the files, which nobody needs to fly them
    """

    URGENT = auto()
    CREW = auto()
    UNCHECKED = auto()
    NO_RULE = auto()
    READING = auto()


@dataclass(frozen=True)
class Note:
    """A sentence on a flight or its files, without a full stop.

    Attributes
    ----------
    text : the note, for all readers
    remedy : a remedy for the author of the scene, not for the crew; empty if there is none
    """

    text: str
    kind: Kind = Kind.CREW
    remedy: str = ""

    def __str__(self) -> str:
        """Returns the whole note."""
        return "; ".join(filter(None, (self.text, self.remedy)))


def notes_of(notes: Iterable[Note], *kinds: Kind) -> list[str]:
    """Returns the texts of the notes that have one of some kinds."""
    return [str(note) for note in notes if note.kind in kinds]

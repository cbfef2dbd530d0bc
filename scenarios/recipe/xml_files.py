"""XML of others, read without entities of its own, which could grow without end."""

from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring

from cocap_opt.data import ProblemError


def root_of(content: bytes, kind: str) -> Element:
    """Returns the outermost element of XML.

    Parameters
    ----------
    kind : of the file, as messages name it

    Raises
    ------
    ProblemError
        If it is damaged, of an encoding that is not known, or has a DOCTYPE.
    """
    try:
        root: Element = fromstring(content, forbid_dtd=True)
    except DefusedXmlException as error:
        raise ProblemError(f"must be {kind} without a DOCTYPE and entities of its own") from error
    except ParseError as error:
        line, _ = error.position
        raise ProblemError(f"line {line}: must be {kind}; it is damaged or cut off") from error
    except (ValueError, LookupError) as error:
        raise ProblemError(f"must be {kind} in UTF-8, not in an unknown encoding") from error
    return root

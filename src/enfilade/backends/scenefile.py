"""What a Mitsuba scene says before any renderer reads it: elements, files that it names, fingerprint."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import parse

from enfilade.errors import SceneError

__all__ = ["SceneFile", "fingerprint"]

PARAMETER = re.compile(r"\$(\w+)")
MB = 1_000_000
XML_MB = 256  # of a scene file itself: meshes stand in files of their own
DEEPEST = 16  # includes within includes, and parameters within parameters
ADVICE = {  # by the suffix of what is no scene
    ".blend": "is Blender's own file; export it with the mitsuba-blender add-on (File > Export > Mitsuba) "
    "and give the XML that it writes: docs/camera-paths.md",
    ".json": "is JSON, and a scene is Mitsuba's XML, or planes and spheres in a file *.analytic.json; "
    "a camera path is given by --path",
}


class SceneFile:
    """A scene file and those that it includes, as Mitsuba's parser takes them.

    Names of files are looked for in the folders that ``<path>`` gives, the last one first, then beside the
    scene, also where an included file names them, and then in the working directory.

    Parameters
    ----------
    file
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self._parameters: dict[str, str] = {}
        self._folders = [file.parent]

    def elements(self) -> Iterator[tuple[Path, Element]]:
        """All elements, each with the file that it stands in; those of an include after the include itself.

        Raises
        ------
        SceneError
            A file can't be read or is malformed. The message names it.
        """
        return self._elements(self.file, depth=0)

    def names(self, file: Path, element: Element) -> Iterator[str]:
        """Names of files in an element of a file; of its other strings, those that lead to one that is there.

        Raises
        ------
        SceneError
            A parameter has no value.
        """
        for key, value in element.attrib.items():
            is_string = element.tag == "string" and key == "value"
            is_name = key == "filename" or (element.tag == "path" and key == "value")
            is_named = is_string and (element.get("name") == "filename" or self._leads_to_one(file, value))
            if is_name or is_named:
                yield value

    def place(self, file: Path, name: str) -> Path:
        """Where Mitsuba finds what an element of a file names; beside the scene where it finds nothing.

        Raises
        ------
        SceneError
            A parameter has no value, or no file can have that name.
        """
        filled = self.filled(file, name)
        places = [folder / filled for folder in (*self._folders, Path())]
        try:
            return next((place for place in places if place.exists()), self.file.parent / filled)
        except OSError as error:
            raise SceneError(f"{file} names a file that can't be looked for: {name!r} ({error})") from error

    def filled(self, file: Path, text: str) -> str:
        """Text of an element of a file with the defaults of its parameters, as Mitsuba fills them in.

        Raises
        ------
        SceneError
            One has none.
        """
        for _ in range(DEEPEST):
            if "$" not in text:
                return text
            text = PARAMETER.sub(lambda found: self._parameters.get(found[1], "\0"), text)
            if "\0" in text:
                break
        raise SceneError(f"{file}: a parameter of {text!r} has no <default>")

    def _elements(self, file: Path, depth: int) -> Iterator[tuple[Path, Element]]:
        root = _parsed(file)
        for element in root.iter("default"):
            self._parameters.setdefault(element.get("name", ""), element.get("value", ""))
        for element in root.iter("path"):
            if depth:
                raise SceneError(
                    f"{file}: Mitsuba does not look in the <path> of an included file; give it in {self.file}"
                )
            self._folders.insert(0, self.place(file, element.get("value", "")))
        for element in root.iter():
            yield file, element
            if element.tag == "include":
                if depth == DEEPEST:
                    raise SceneError(f"{file} includes files that include files, more than {DEEPEST} deep")
                yield from self._elements(self.place(file, element.get("filename", "")), depth + 1)

    def _leads_to_one(self, file: Path, value: str) -> bool:
        # Not in the working directory: any word may be the name of something there.
        filled = self.filled(file, value)
        try:
            return any((folder / filled).exists() for folder in self._folders)
        except OSError:  # too long: no file's name
            return False


def fingerprint(scene: Path) -> str:
    """SHA-256 over a scene file and every file that it names, in the order in which they are named.

    Raises
    ------
    SceneError
        A file can't be read or is malformed.
    """
    read = SceneFile(scene)
    files = {scene: None}
    for file, element in read.elements():
        for name in read.names(file, element):
            files[read.place(file, name)] = None
    digest = hashlib.sha256()
    for file in files:
        if file.is_file():
            with file.open("rb") as stream:
                digest.update(hashlib.file_digest(stream, "sha256").digest())
        elif not file.is_dir():
            digest.update(f"there is no {file.name}".encode())
    return digest.hexdigest()


def _parsed(file: Path) -> Element:
    try:
        size = file.stat().st_size
        if advice := ADVICE.get(file.suffix.lower()):
            raise SceneError(f"{file} {advice}")
        if size > XML_MB * MB:
            raise SceneError(f"{file} has {size / MB:.0f} MB; a scene file may have {XML_MB}")
        root: Element = parse(file, forbid_dtd=True).getroot()
    except OSError as error:
        raise SceneError(f"can't read the scene {file}: {error.strerror}") from error
    except ParseError as error:
        raise SceneError(f"{file} is not well-formed XML: {error}") from error
    except DefusedXmlException as error:
        raise SceneError(f"{file} has a document type or entities, which scenes have no need of") from error
    except (ValueError, LookupError) as error:  # an encoding that nobody knows
        raise SceneError(f"{file} can't be read as XML: {error}") from error
    return root

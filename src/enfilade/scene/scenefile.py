"""What a Mitsuba scene says before any renderer reads it: elements, files that it names, fingerprint."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser, parse

from enfilade.errors import SceneError
from enfilade.scene.parameters import Parameters

__all__ = ["Demands", "Name", "SceneFile", "as_loaded", "fingerprint", "named_files"]

MB = 1_000_000
XML_MB = 256  # of a scene file itself: meshes stand in files of their own
DEEPEST = 16  # includes within includes
DECLARATION = 4096  # bytes in which <?xml ... ?> must end
ENCODING = re.compile(rb"encoding\s*=\s*[\"']([^\"']*)")
ENCODINGS = (b"utf-8", b"utf8", b"us-ascii", b"ascii")
ADVICE = {  # by the suffix of what is no scene
    ".blend": "is Blender's own file; export it with the mitsuba-blender add-on (File > Export > Mitsuba) "
    "and give the XML that it writes: docs/camera-paths.md",
    ".json": "is JSON, and a scene is Mitsuba's XML, or planes and spheres in a file *.analytic.json; "
    "a camera path is given by --path",
}


@dataclass(frozen=True)
class Name:
    """A file's name in a scene.

    Parameters
    ----------
    file
        The XML file that names it.
    text
        The name, its parameters filled in.
    place
        Where Mitsuba finds it; beside the scene where it finds nothing.
    """

    file: Path
    text: str
    place: Path


@dataclass(frozen=True)
class Demands:
    """All that a scene asks for.

    Parameters
    ----------
    files
        XML files: the scene and what it includes, links followed.
    plugins
        Their names.
    strings
        Name and value of each ``<string>``.
    """

    files: frozenset[Path]
    plugins: frozenset[str]
    strings: frozenset[tuple[str, str]]


class SceneFile:
    """A scene file and those that it includes, as Mitsuba's parser takes them.

    Names of files are looked for in the folders that ``<path>`` gives, the last one first, then beside the
    scene, also where an included file names them, and then in the working directory. Includes are looked
    for beside the file that has them before all else, and, as files of spectra, only in folders that a
    ``<path>`` has given before.

    Parameters
    ----------
    file
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self._parameters = Parameters()
        self._folders = [file.parent]
        self._strings: list[tuple[Path, Element]] = []

    def elements(self) -> Iterator[tuple[Path, Element, list[Name]]]:
        """All elements, parameters filled in, those of an include after the include itself.

        To be gone through once. An included file is not looked at before its ``<include>`` has been given.

        Yields
        ------
        tuple
            The XML file, the element, and names of the files that Mitsuba reads as soon as it comes to it.

        Raises
        ------
        SceneError
            A file can't be read or is malformed; a parameter has no value. The message names the file.
        """
        return self._elements(self.file, self._folders, depth=0)

    def strings(self) -> Iterator[tuple[Element, Name]]:
        """Names of files in strings, which Mitsuba looks for when it has read all elements; so after them.

        Strings with the name ``filename``, and others that lead to a file that is there.

        Raises
        ------
        SceneError
            No file can have that name.
        """
        for file, element in self._strings:
            value = element.get("value", "")
            if element.get("name") == "filename" or self._leads_to_one(value):
                yield element, self._name(file, value, self._folders)

    def demands(self) -> Demands:
        """Read all, instead of going through the elements.

        Raises
        ------
        SceneError
            See :meth:`elements`.
        """
        files, plugins = set(), {"scene"}
        for file, element, _ in self.elements():
            files.add(file.resolve())
            plugins.add(element.get("type", "scene"))
        strings = frozenset((e.get("name", ""), e.get("value", "")) for _, e in self._strings)
        return Demands(frozenset(files), frozenset(plugins), strings)

    def _elements(
        self, file: Path, folders: list[Path], depth: int
    ) -> Iterator[tuple[Path, Element, list[Name]]]:
        if depth > DEEPEST:
            raise SceneError(f"{file} includes files that include files, more than {DEEPEST} deep")
        for element in _parsed(file).iter():
            self._fill(file, element)
            # A name without a folder has no parent for Mitsuba.
            beside = [file.parent, *folders] if file.parent != Path() else [*folders]
            names = []
            match element.tag:
                case "include":
                    names = [self._name(file, element.get("filename", ""), beside)]
                case "path" if depth:
                    raise SceneError(
                        f"{file}: Mitsuba does not look in the <path> of an included file; give it in "
                        f"{self.file}"
                    )
                case "path":
                    names = [self._name(file, element.get("value", ""), [file.parent, *folders])]
                case "string":
                    self._strings.append((file, element))
                case _ if "filename" in element.attrib:
                    names = [self._name(file, element.get("filename", ""), folders)]
            yield file, element, names
            match element.tag:
                case "include":
                    yield from self._elements(names[0].place, beside, depth + 1)
                case "path":
                    self._folders.insert(0, names[0].place)
                case "default":
                    self._define(file, element)

    def _fill(self, file: Path, element: Element) -> None:
        if "}" in element.tag or any("}" in key for key in element.attrib):
            raise SceneError(f"{file} has namespaces, which Mitsuba does not know")
        try:
            for key, text in element.attrib.items():
                element.set(key, self._parameters.filled(text))
        except ValueError as error:
            raise SceneError(f"{file}: {error}") from error

    def _define(self, file: Path, element: Element) -> None:
        try:
            self._parameters.define(element.get("name", ""), element.get("value", ""))
        except ValueError as error:
            raise SceneError(f"{file} has {error}") from error

    def _name(self, file: Path, text: str, folders: Sequence[Path]) -> Name:
        places = [folder / text for folder in (*folders, Path.cwd())]
        try:
            return Name(file, text, next((p for p in places if p.exists()), self.file.parent / text))
        except OSError as error:
            raise SceneError(f"{file} names a file that can't be looked for: {text!r} ({error})") from error

    def _leads_to_one(self, value: str) -> bool:
        # Not in the working directory: any word may be the name of something there.
        try:
            return any((folder / value).exists() for folder in self._folders)
        except OSError:  # too long: no file's name
            return False


def as_loaded(scene: Path) -> list[Path]:
    """Names by which a scene is loaded: as it is, and by worker processes as a whole path, links followed.

    It is one where Mitsuba finds the same files by both.
    """
    whole = scene.resolve()
    is_same = scene.parent != Path() and scene.parent.resolve() / scene.name == whole
    return [scene] if is_same else [scene, whole]


def named_files(scene: Path) -> list[Path]:
    """A scene file and every file that it names, each once: what Mitsuba reads first, then the rest.

    Raises
    ------
    SceneError
        A scene file can't be read or is malformed.
    """
    read = SceneFile(scene)
    files = {scene: None}
    for _, _, names in read.elements():
        files.update((name.place, None) for name in names)
    files.update((name.place, None) for _, name in read.strings())
    return list(files)


def fingerprint(scene: Path) -> str:
    """SHA-256 over a scene file and every file that it names.

    Raises
    ------
    SceneError
        A file can't be read or is malformed.
    """
    digest = hashlib.sha256()
    for file in named_files(scene):
        try:
            if file.is_file():
                with file.open("rb") as stream:
                    digest.update(hashlib.file_digest(stream, "sha256").digest())
            elif not file.is_dir():
                digest.update(f"there is no {file.name}".encode())
        except OSError as error:
            raise SceneError(f"can't read {file}, which {scene} names: {error.strerror}") from error
    return digest.hexdigest()


def why_unreadable(scene: Path) -> OSError | None:
    """Say what the operating system says of a scene's files, where one can't be read: libraries keep it."""
    try:
        fingerprint(scene)
    except SceneError as error:
        return error.__cause__ if isinstance(error.__cause__, OSError) else None
    return None


def _parsed(file: Path) -> Element:
    try:
        size = file.stat().st_size
        if advice := ADVICE.get(file.suffix.lower()):
            raise SceneError(f"{file} {advice}")
        if size > XML_MB * MB:
            raise SceneError(f"{file} has {size / MB:.0f} MB; a scene file may have {XML_MB}")
        with file.open("rb") as raw:
            _check_encoding(file, raw.read(DECLARATION))
            raw.seek(0)
            # Whatever it declares: Mitsuba knows few encodings, and takes all others to be UTF-8.
            parser = DefusedXMLParser(encoding="utf-8", forbid_dtd=True)
            root: Element = parse(raw, parser).getroot()
    except OSError as error:
        raise SceneError(f"can't read the scene {file}: {error.strerror}") from error
    except ParseError as error:
        raise SceneError(f"{file} is not well-formed XML: {error}") from error
    except DefusedXmlException as error:
        raise SceneError(f"{file} has a document type or entities, which scenes have no need of") from error
    except ValueError as error:
        raise SceneError(f"{file} can't be read as XML: {error}") from error
    return root


def _check_encoding(file: Path, start: bytes) -> None:
    if b"\0" in start[:4]:  # of UTF-16 or UTF-32, with a mark before it or without
        raise SceneError(f"{file} is XML in the encoding 'utf-16', or none; save it as UTF-8")
    declaration, end, _ = start.removeprefix(b"\xef\xbb\xbf").partition(b"?>")
    if not declaration.startswith(b"<?xml"):
        return
    found = ENCODING.search(declaration)
    if not end or (found and found[1].lower() not in ENCODINGS):
        name = found[1].decode(errors="replace") if found else "?"
        raise SceneError(f"{file} is XML in the encoding {name!r}; save it as UTF-8")

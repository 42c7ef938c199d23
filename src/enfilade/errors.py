"""What can go wrong, as one tree.

::

    EnfiladeError                 anything this package raises on purpose; the command exits with 1
    ├── InputError                what the user gave can't be used; the command exits with 2
    │   ├── SceneError            a scene file: missing, malformed, or refused by the renderer
    │   ├── CameraPathError       a camera path: malformed, not rigid, empty
    │   ├── SettingsError         a setting: unknown, or out of range
    │   ├── ImageError            an image, a sequence or a video that can't be read or compared
    │   └── RunFolderError        a run folder: holds another run, damaged, can't be written
    │       └── DamagedFileError  a file of it that is missing, or isn't what was written
    ├── DeviceError               no usable LLVM or CUDA on this machine
    ├── NoSpaceError              the disk is full; what is finished stays
    └── UnfinishedError           parts of a run that failed again and again, and were left out

A message says what is wrong, where, and what to do next.
"""


class EnfiladeError(Exception):
    """Anything this package raises on purpose."""


class InputError(EnfiladeError, ValueError):
    """What the user gave can't be used."""


class SceneError(InputError):
    """A scene file that is missing, malformed, or refused by the renderer."""


class CameraPathError(InputError):
    """A camera path that is malformed, not rigid, or empty."""


class SettingsError(InputError):
    """A setting that is unknown or out of range."""


class ImageError(InputError):
    """An image, a sequence or a video that can't be read or compared."""


class RunFolderError(InputError):
    """A run folder that holds another run, is damaged, or can't be written."""


class DamagedFileError(RunFolderError):
    """A file of a run folder that is missing, or isn't what was written.

    Attributes
    ----------
    file : str
    """

    def __init__(self, message: str, file: str) -> None:
        super().__init__(message)
        self.file = file

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle with all that the constructor takes: errors pass from one process to another."""
        return type(self), (str(self), self.file), self.__dict__


class DeviceError(EnfiladeError):
    """No usable LLVM or CUDA on this machine."""


class NoSpaceError(EnfiladeError):
    """The disk is full; what is finished stays."""


class UnfinishedError(EnfiladeError):
    """Parts of a run that failed again and again, and were left out.

    Attributes
    ----------
    tasks : tuple of str
        Their names.
    """

    def __init__(self, message: str, tasks: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.tasks = tasks

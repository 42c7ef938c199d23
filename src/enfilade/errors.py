"""The errors of this package, as one tree.

::

    EnfiladeError                 every error that is raised on purpose; the command exits with 1
    ├── InputError                unusable input; the command exits with 2
    │   ├── SceneError            a scene: missing, malformed, or refused by the renderer
    │   ├── CameraPathError       a camera path: malformed, not rigid, empty
    │   ├── SettingsError         a setting: unknown, or out of range
    │   ├── ImageError            an image, a sequence or a video that can't be read or compared
    │   └── RunFolderError        a run folder: of another run, damaged, not writable
    │       └── DamagedFileError  a file of it that is missing, or differs from its checksum
    ├── DeviceError               no usable LLVM or CUDA
    ├── NoSpaceError              the disk is full; finished tasks stay
    └── UnfinishedError           tasks of a run failed and were quarantined, or are not done yet

A message says what is wrong, where, and what to do next.
"""


class EnfiladeError(Exception):
    """Every error that is raised on purpose."""


class InputError(EnfiladeError, ValueError):
    """Unusable input."""


class SceneError(InputError):
    """A scene that is missing, malformed, or refused by the renderer."""


class CameraPathError(InputError):
    """A camera path that is malformed, not rigid, or empty."""


class SettingsError(InputError):
    """A setting that is unknown or out of range."""


class ImageError(InputError):
    """An image, a sequence or a video that can't be read or compared."""


class RunFolderError(InputError):
    """A run folder that holds another run, is damaged, or is not writable."""


class DamagedFileError(RunFolderError):
    """A file of a run folder that is missing, or differs from its checksum.

    Attributes
    ----------
    file : str
        Its name in the run folder.
    """

    def __init__(self, message: str, file: str) -> None:
        super().__init__(message)
        self.file = file

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle with all arguments of the constructor: errors pass from process to process."""
        return type(self), (str(self), self.file), self.__dict__


class DeviceError(EnfiladeError):
    """No usable LLVM or CUDA."""


class NoSpaceError(EnfiladeError):
    """The disk is full; finished tasks stay."""


class UnfinishedError(EnfiladeError):
    """Tasks of a run are not done: they failed again and again, or an earlier pass or a frame is missing.

    Attributes
    ----------
    tasks : tuple of str
        Names of those that were quarantined, or whose frames are missing.
    """

    def __init__(self, message: str, tasks: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.tasks = tasks

"""The tree of errors, as its docstring draws it."""

import inspect
import pickle
import re

import pytest

from enfilade import errors


def test_the_docstring_draws_every_error_in_its_place():
    classes = dict(inspect.getmembers(errors, inspect.isclass))
    drawn = re.findall(r"^    ([│├└─ ]*)(\w+Error)", errors.__doc__, re.MULTILINE)
    assert [name for _, name in drawn] == list(dict.fromkeys(name for _, name in drawn))
    assert {name for _, name in drawn} == set(classes)
    above: list[str] = []
    for indent, name in drawn:
        depth = len(indent) // 4
        above[depth:] = [name]
        if depth:
            assert classes[above[depth - 1]] in classes[name].__bases__


def test_wrong_input_is_a_value_error_and_a_missing_device_is_not():
    assert issubclass(errors.InputError, ValueError)
    assert not issubclass(errors.DeviceError, ValueError)


@pytest.mark.parametrize("kind", [cls for _, cls in inspect.getmembers(errors, inspect.isclass)])
def test_every_error_passes_from_one_process_to_another(kind):
    facts = {errors.DamagedFileError: ("0001.exr",), errors.UnfinishedError: (("frame 1",),)}
    error = kind("it is broken", *facts.get(kind, ()))
    error.add_note("while it was read")
    got = pickle.loads(pickle.dumps(error))  # noqa: S301  (our own)
    assert type(got) is kind
    assert (str(got), got.__dict__) == ("it is broken", error.__dict__)

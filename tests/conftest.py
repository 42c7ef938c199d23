"""The device is chosen before any test module imports a kernel: Dr.Jit binds its array types at import."""

import hypothesis

from enfilade.device import activate

activate("auto")
hypothesis.settings.register_profile("enfilade", deadline=None)  # a busy machine is no failure
hypothesis.settings.load_profile("enfilade")

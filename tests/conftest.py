"""The device is chosen before any test module imports a kernel: Dr.Jit binds its array types at import."""

from enfilade.device import activate

activate("auto")

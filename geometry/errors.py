"""The one exception a user's input can raise."""

from __future__ import annotations

from pathlib import Path


class InputError(ValueError):
    """Input that cannot be used, said in one line: which file, which key, what was given, what is allowed.

    Parameters
    ----------
    allowed
        The rule the input breaks, as a sentence fragment ("must be a positive length").
    file
        The file it stands in, if any.
    key
        Dotted path of the key inside the file ("membrane.thickness").
    given
        The offending value as the user wrote it.

    Examples
    --------
    >>> str(InputError("must be a positive length", file="a.toml", key="plate.radius", given="-1 cm"))
    "a.toml: plate.radius: given '-1 cm': must be a positive length"
    """

    def __init__(
        self, allowed: str, *, file: Path | str | None = None, key: str | None = None, given: object = None
    ) -> None:
        self.allowed, self.file, self.key, self.given = allowed, file, key, given
        parts = [str(part) for part in (file, key) if part is not None]
        if given is not None:
            parts.append(f"given {given!r}")
        super().__init__(": ".join([*parts, allowed]))

    def located(self, *, file: Path | str | None = None, key: str | None = None) -> InputError:
        """A copy that also names where the value stood; what is already named is kept."""
        return InputError(self.allowed, file=self.file or file, key=self.key or key, given=self.given)


class MissingLibrary(RuntimeError):
    """A shared library of the operating system that gmsh, OpenCASCADE or VTK needs is not installed."""


#: Debian packages of the shared libraries that gmsh, OpenCASCADE and VTK load.
_DEBIAN = {
    "libGL.so.1": "libgl1", "libGLU.so.1": "libglu1-mesa", "libEGL.so.1": "libegl1", "libX11.so.6": "libx11-6",
    "libXrender.so.1": "libxrender1", "libXcursor.so.1": "libxcursor1", "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1", "libXfixes.so.3": "libxfixes3", "libXext.so.6": "libxext6",
    "libSM.so.6": "libsm6", "libICE.so.6": "libice6", "libfontconfig.so.1": "libfontconfig1",
    "libgomp.so.1": "libgomp1", "libXi.so.6": "libxi6", "libxcb.so.1": "libxcb1",
}


def missing_library(error: OSError | ImportError) -> MissingLibrary:
    """What to install when loading a shared library failed.

    Examples
    --------
    >>> print(missing_library(OSError("libGLU.so.1: cannot open shared object file: No such file or directory")))
    the system library libGLU.so.1 is missing: install the Debian package libglu1-mesa (or your system's counterpart)
    """
    name = str(error).split(":")[0].strip()
    package = _DEBIAN.get(name)
    if package is None:
        return MissingLibrary(f"a system library cannot be loaded: {error}")
    return MissingLibrary(f"the system library {name} is missing: install the Debian package {package} "
                          "(or your system's counterpart)")

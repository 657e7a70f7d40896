"""gritd: learns the soil under a rover wheel while the wheel drives.

`import gritd` loads nothing else; each name of `__all__` is loaded when it is asked for, and
documented in docs/python.md. The command line is `gritd` or `python -m gritd`. The subpackages
`gritd.estimator`, `gritd.drivers`, `gritd.config` and `gritd.tools` may change with every version.
"""

TYPE_CHECKING = False  # a type checker takes it for true; `typing` would be loaded for nothing
if TYPE_CHECKING:
    from gritd import terramechanics
    from gritd.interface.diagnosis import diagnose
    from gritd.interface.filtering import Filter
    from gritd.interface.runs import read
    from gritd.interface.simulation import simulate

__all__ = ["Filter", "__version__", "diagnose", "read", "simulate", "terramechanics"]

__version__ = "1.0.0"

_HOME = {
    "Filter": "gritd.interface.filtering",
    "diagnose": "gritd.interface.diagnosis",
    "read": "gritd.interface.runs",
    "simulate": "gritd.interface.simulation",
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name == "terramechanics":
        return import_module("gritd.terramechanics")
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'gritd' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)

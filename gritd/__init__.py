"""gritd: learns the soil under a rover wheel while the wheel drives.

`import gritd` loads nothing else. The command line is `gritd` or `python -m gritd`. The subpackages
`gritd.estimator`, `gritd.drivers`, `gritd.config` and `gritd.tools` are imported by their full
names and may change with every version.
"""

__all__ = ["__version__"]

__version__ = "0.1.0"

"""The arithmetic of a tick in C, with the same bits as the Python beside it; where there is no
compiler, that serves. All else stands in pyproject.toml.

One build serves every Python (the limited API), and names no folder of the computer that built it
(-g0). A product must not be fused with a sum, nor sine and cosine be taken in one. SOURCES is what
estimator/compiled/sources.py compares: a module of other sources than those beside it is not used.
"""

from pathlib import Path
from zlib import crc32

from setuptools import Extension, setup

FOLDER = Path("estimator/compiled")
FILES = sorted(FOLDER.glob("*.[ch]"))
SOURCES = crc32(b"".join(file.read_bytes() for file in FILES))
NOT_FUSED = "-ffp-contract=off"
FLAGS = {
    "algebra": [NOT_FUSED],
    "balance": [],
    "checksum": [],
    "closed": [NOT_FUSED, "-fno-builtin-sin", "-fno-builtin-cos"],
    "innovations": [NOT_FUSED],
    "messages": [],
    "record": [NOT_FUSED],
}


def module(name: str, flags: list[str]) -> Extension:
    return Extension(
        f"gritd.estimator.compiled.{name}",
        [str(FOLDER / f"{name}.c")],
        depends=[str(file) for file in FILES],
        extra_compile_args=["-O3", "-g0", *flags],
        define_macros=[("Py_LIMITED_API", "0x030b0000"), ("SOURCES", f"{SOURCES}U")],
        libraries=["m"],
        py_limited_api=True,
        optional=True,
    )


setup(ext_modules=[module(name, flags) for name, flags in FLAGS.items()])

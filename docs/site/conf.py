"""Sphinx: how the pages of docs/ become the site (`make site`). toc.yml has their order."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.inspect import TypeAliasForwardRef

from gritd import __version__

sys.path.insert(0, str(Path(__file__).parent))

project, author, copyright = "gritd", "the contributors of gritd", "the contributors of gritd"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_external_toc", "mathml"]
external_toc_path = "site/toc.yml"
external_toc_exclude_missing = True
exclude_patterns = ["effects/*", "site/*.py"]
highlight_language = "none"
smartquotes = False  # "--option" stays as it is

myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
myst_links_external_new_tab = True

default_role = "code"  # of docstrings
autodoc_type_aliases = {name: name for name in ("Place", "Series", "Table")}
TypeAliasForwardRef.__repr__ = lambda alias: alias.name
autodoc_member_order = "bysource"
autodoc_typehints = "signature"

html_theme = "pydata_sphinx_theme"
html_title = "gritd"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "navbar_align": "left",
    "navbar_persistent": ["search-button"],
    "header_links_before_dropdown": 6,
    "show_toc_level": 2,
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
}


def parameters_as_fields(*event: Any) -> None:
    """`name: meaning` in a docstring of ours is a parameter's line."""
    lines: list[str] = event[-1]
    lines[:] = [re.sub(r"^(\w+): ", r":param \1: ", line) for line in lines]


def setup(app: Sphinx) -> None:
    app.connect("autodoc-process-docstring", parameters_as_fields)

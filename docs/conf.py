"""Sphinx configuration: ``sphinx-build -W docs docs/_build``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import smolux

project = "smolux"
author = "The smolux developers"
copyright = "the smolux developers, BSD 3-Clause"
version = release = smolux.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "reference_tables",
]

exclude_patterns = ["_build", "_ext", "Thumbs.db", "auto_examples/**/README*"]
default_role = "py:obj"
templates_path = ["_templates"]

myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence", "fieldlist"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"  # the docstrings give the types, with shapes
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "auto_examples",
    "filename_pattern": r"[\\/]plot_",
    "image_scrapers": ("saved_figures",),
    "within_subsection_order": "FileNameSortKey",
    "show_memory": False,
    "write_computation_times": False,
    "remove_config_comments": True,
    "download_all_examples": False,
    "min_reported_time": 1e9,
    # pages can be read without waiting for the simulations: SMOLUX_DOCS_EXAMPLES=0
    "plot_gallery": os.environ.get("SMOLUX_DOCS_EXAMPLES", "1") != "0",
}

html_theme = "pydata_sphinx_theme"
html_title = "smolux"
html_static_path = ["_static"]
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "navbar_align": "left",
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_show_sourcelink = False
html_copy_source = False

"""Sphinx: the pages of docs and the API reference, made from the docstrings."""

import pipecore

project = "PipeGUI"
version = release = pipecore.__version__
language = "en"

extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "myst_parser"]
root_doc = "index"
exclude_patterns = ["images", "api/templates"]
html_theme = "alabaster"
html_theme_options = {"description": "Pipes in laser scans, and where they are deformed"}
myst_heading_anchors = 3

autosummary_generate = True
templates_path = ["api/templates"]
autodoc_typehints = "none"  # the docstrings say types, shapes and units
autodoc_default_options = {"members": True}
numpydoc_show_class_members = False

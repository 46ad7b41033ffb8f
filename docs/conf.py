"""Sphinx: the pages of docs and the API reference, made from the docstrings."""

import pipecore

project = "PipeGUI"
version = release = pipecore.__version__
language = "en"
copyright = "The PipeGUI authors"  # noqa: A001 - as Sphinx calls it
default_role = "py:obj"  # names in docstrings are links to their pages

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


def escape_bars(app, what, name, obj, options, lines):
    """Show “|” of texts as it stands: Sphinx would look for a substitution."""
    lines[:] = [line.replace("|", r"\|") if "``" not in line else line for line in lines]


def setup(app):
    """Connect what is above to Sphinx."""
    app.connect("autodoc-process-docstring", escape_bars)

"""Settings of Sphinx; `build.py` runs it."""

from importlib.metadata import version as version_of

project = "mcnav"
version = release = version_of("mcnav")
language = "en"
smartquotes = False  # options begin with two hyphens
html_show_search_summary = False  # a browser does not let a file fetch others
html_title = f"mcnav {version}"
html_copy_source = html_show_sourcelink = html_show_sphinx = html_show_copyright = False

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
source_suffix = {".md": "markdown"}
root_doc = "index"
default_role = "literal"  # docstrings quote names of code by single backticks
myst_heading_anchors = 4  # as GitHub makes them
suppress_warnings = ["misc.highlighting_failure"]  # TOML with an ellipsis is no TOML to the lexer

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True}
numpydoc_show_class_members = autosummary_generate = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 80

# Types in signatures: those of other packages, whose inventories would need a network, and those of no public name.
nitpick_ignore_regex = [
    ("py:class", r"(collections\.abc|pathlib|numpy|pandas|pd|xr|mcnav)\..*|MplFigure|Axes|Path|Units")
]

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_theme_options = {"navigation_with_keys": False}

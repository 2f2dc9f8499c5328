"""The documentation's site: ``make docs``, or ``sphinx-build -W docs FOLDER``.

With ``VJM_DOCS_QUICK=1`` the gallery's scripts are listed and not run, so that the pages lack their figures.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator as HTMLTranslator

sys.path.insert(0, str(Path(__file__).parent))
from reference_pages import write_reference

import vjm

LOG = logging.getLogger(__name__)
project = "vjm-stiffness"
author = "the authors of vjm-stiffness"
release = version = vjm.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["gallery/README.rst", "gallery/*.py", "schemas"]
html_theme = "furo"
html_title = f"vjm-stiffness {release}"
html_math_renderer = "mathml"
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
nitpicky = False
html_static_path = ["static"]
html_css_files = ["site.css"]
QUICK = os.environ.get("VJM_DOCS_QUICK") == "1"
suppress_warnings = ["config.cache", *(["image.not_readable"] if QUICK else [])]
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "gallery_built",
    "filename_pattern": r"/plot_",
    "plot_gallery": not QUICK,
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "min_reported_time": 1e6,
}


def _math(translator: HTMLTranslator, node: nodes.Element) -> None:
    """Formulas as MathML, which browsers know by themselves: a page asks nobody for a script."""
    block = isinstance(node, nodes.math_block)
    # docutils knows no tags; TeX takes one digit each, docutils the number
    text = re.sub(r"\\tag\{(\w+)\}", r"\\qquad \\text{(\1)}", node.astext())
    text = re.sub(r"(\\[td]?frac)\s*(\d)\s*(\d)", r"\1{\2}{\3}", text)
    try:
        made = tex2mathml(text, as_block=block)
        # a wide one scrolls by itself on a narrow screen
        translator.body.append(f'<div style="overflow-x: auto; padding: 0.6em 0">{made}</div>' if block else made)
    except MathError as error:
        LOG.warning("a formula cannot be read: %s: %s", node.astext(), error, location=node)
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """What the pages are made of beside what stands in them."""
    app.add_html_math_renderer("mathml", (_math, None), (_math, None))
    write_reference(Path(__file__).parent / "reference")

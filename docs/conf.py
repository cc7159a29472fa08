"""The documentation site: ``make docs``; see docs/index.md."""

from __future__ import annotations

import os
import shutil
import sys
from contextlib import redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
os.environ["PYVISTA_OFF_SCREEN"] = os.environ["PYVISTA_BUILDING_GALLERY"] = "true"

import pyvista  # noqa: E402
from docutils import nodes  # noqa: E402

from tympan.cli import main  # noqa: E402
from tympan.commands import COMMANDS, HEADINGS  # noqa: E402

pyvista.OFF_SCREEN = pyvista.BUILDING_GALLERY = True
pyvista.set_plot_theme("document")
pyvista.global_theme.window_size = [1000, 700]

# Scripts leave their files where they stand.
GALLERY = ROOT / "build" / "gallery"
shutil.rmtree(GALLERY, ignore_errors=True)
shutil.copytree(ROOT / "docs" / "gallery", GALLERY)
for script in GALLERY.glob("plot_*.py"):  # within code: a block of its own would be shown, empty
    picture = f"thumbnails/{script.stem[:6]}.png"
    text = script.read_text(encoding="utf-8").replace(
        "\nimport tympan\n", f'\nimport tympan\n# sphinx_gallery_thumbnail_path = "{picture}"\n', 1)
    script.write_text(text, encoding="utf-8")

project = "tympan"
author = "the tympan authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_design",
              "sphinx_gallery.gen_gallery"]
exclude_patterns = ["gallery", "tutorials/*.ipynb", "tutorials/*.py", "tutorials/README.txt",
                    "**sg_execution_times.rst"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4
suppress_warnings = ["config.cache"]  # the scraper of sphinx-gallery is a function
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
add_module_names = False

sphinx_gallery_conf = {
    "examples_dirs": str(GALLERY), "gallery_dirs": "tutorials", "filename_pattern": r"plot_\d",
    "image_scrapers": ("matplotlib", "pyvista"), "download_all_examples": False,
    "matplotlib_animations": True,
    "show_signature": False, "min_reported_time": 1e9, "within_subsection_order": "FileNameSortKey",
    "remove_config_comments": True, "abort_on_example_error": True,
    "capture_repr": ("_repr_html_",), "show_memory": False,
}

html_theme = "pydata_sphinx_theme"
html_title = "tympan"
html_show_sphinx = False
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["tympan.css"]
html_theme_options: dict[str, Any] = {
    "show_toc_level": 2, "navigation_with_keys": False, "show_prev_next": True,
    "header_links_before_dropdown": 6, "footer_start": ["copyright"], "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars: dict[str, list[str]] = {"index": [], "start": []}
copyright = "the tympan authors, BSD-3-Clause"


def help_of(command: str) -> str:
    """Text that ``tympan COMMAND --help`` prints."""
    printed = StringIO()
    with redirect_stdout(printed), suppress(SystemExit):
        main([*command.split(), "--help"])
    return printed.getvalue().rstrip()


def write_commands(app: Any) -> None:
    """The help of every command as docs/commands.md."""
    os.environ["COLUMNS"] = "84"
    lines = ["# Commands", "", "What `tympan COMMAND --help` prints.", ""]
    for heading, commands in HEADINGS.items():
        lines += [f"## {heading}", ""]
        for command in commands:
            lines += [f"### {command.name}", "", "```text", help_of(command.name), "```", ""]
    assert len(COMMANDS) == sum(line.startswith("### ") for line in lines)
    page = Path(app.srcdir) / "commands.md"
    text = "\n".join(lines)
    if not page.exists() or page.read_text(encoding="utf-8") != text:
        page.write_text(text, encoding="utf-8")


def name_thumbnails(app: Any, doctree: Any, _: str) -> None:
    """A thumbnail, which sphinx-gallery leaves without words, is called what its tutorial is."""
    for image in doctree.findall(nodes.image):
        name = Path(image["uri"]).stem.removeprefix("sphx_glr_").removesuffix("_thumb")
        if not image.get("alt"):
            image["alt"] = app.env.titles[f"tutorials/{name}"].astext()


def hide_factories(*event: Any) -> tuple[str | None, str | None]:
    """A default that is made for each object is three dots."""
    signature, answer = event[-2:]
    return signature and signature.replace("<factory>", "..."), answer


def setup(app: Any) -> None:
    """Sphinx calls it."""
    app.connect("autodoc-process-signature", hide_factories)
    app.connect("builder-inited", write_commands, priority=1)
    app.connect("doctree-resolved", name_thumbnails)

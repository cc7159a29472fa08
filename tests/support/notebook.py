"""Write examples/first_actuator.ipynb: the first tutorial, run from top to bottom.

``python -m tests.support.notebook``, with nbclient and ipykernel installed beside the rest.
"""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "docs/gallery/plot_1_first_actuator.py"
FILE = ROOT / "examples/first_actuator.ipynb"
#: A picture, by its name within docs/, and its words.
_IMAGE = re.compile(r"\.\. image:: (\S+)\n   :alt: (.+)")


def markdown(text: str) -> str:
    """Headings and code of a tutorial's text as notebooks have them."""
    text = re.sub(r"^(.+)\n=+$", r"# \1", text, flags=re.MULTILINE)
    text = re.sub(r"^(.+)\n-+$", r"## \1", text, flags=re.MULTILINE)
    text = _IMAGE.sub(r"![\2](../docs\1)", text)
    return text.replace("``", "`").strip()


def cells(script: str) -> list[Any]:
    """The head, then text and code of every block."""
    from nbformat.v4 import new_code_cell, new_markdown_cell

    head, _, blocks = script.removeprefix('"""\n').partition('"""\n')
    made = [new_markdown_cell(markdown(head), id="head")]
    for number, block in enumerate(blocks.split("# %%\n")[1:]):
        text, code = re.fullmatch(r"((?:#[^\n]*\n)*)(.*)", block, re.DOTALL).groups()
        made.append(new_markdown_cell(markdown(re.sub("^# ?", "", text, flags=re.MULTILINE)),
                                      id=f"text-{number}"))
        if code.strip():
            made.append(new_code_cell(code.strip(), id=f"code-{number}"))
    return made


def is_shown(output: Any) -> bool:
    """Whether an output is worth keeping: no warnings, no names of axes."""
    return (output.get("name") != "stderr"
            and "<Axes" not in str(output.get("data", {}).get("text/plain", "")))


def main() -> None:
    """Run it and write it."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.v4.new_notebook(cells=cells(SCRIPT.read_text(encoding="utf-8")))
    with TemporaryDirectory() as folder:
        NotebookClient(notebook, timeout=300, kernel_name="python3",
                       resources={"metadata": {"path": folder}}).execute()
    notebook.metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3",
                                        "language": "python"},
                         "language_info": {"name": "python"}}
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if is_shown(output)]
            for output in cell.outputs:
                output.get("data", {}).pop("image/jpeg", None)
                if "text/html" in output.get("data", {}):
                    output["data"]["text/plain"] = "a result"
    nbformat.validate(notebook)
    FILE.parent.mkdir(exist_ok=True)
    nbformat.write(notebook, FILE)


if __name__ == "__main__":
    main()

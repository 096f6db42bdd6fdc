"""Runs docs/notebooks/*.ipynb cell by cell, in this environment and this directory."""

import os
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def main():
    found = sorted((Path(os.environ["VITREO_UQ_SOURCE"]) / "docs/notebooks").glob("*.ipynb"))
    assert found, "there is no notebook"
    for path in found:
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        assert not any(cell.get("outputs") for cell in notebook.cells), f"{path.name} was committed with outputs"
        NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    print(f"{len(found)} ran")


if __name__ == "__main__":
    main()

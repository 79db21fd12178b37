"""Execute the notebooks and keep light outputs in them, or check that their outputs are fresh.

    python docs/tools/notebooks.py --write [NAME.ipynb ...]
    python docs/tools/notebooks.py --check

Each notebook remembers a hash of its code, so `--check` needs no execution: outputs are fresh if
the code is what was executed, and light if no picture is above `MAX_PICTURE` bytes of base64.
"""

import argparse
import base64
import hashlib
import io
import sys
from pathlib import Path

import nbformat

FOLDER = Path(__file__).parents[2] / "notebooks"
MAX_PICTURE = 60_000
COLOURS = 48
WIDTHS = (760, 640, 520, 400)
KEPT = ("image/png", "text/markdown", "text/plain")


def code_hash(notebook) -> str:
    """Of all that is executed, without which space."""
    code = "\n\n".join(cell.source.strip() for cell in notebook.cells if cell.cell_type == "code")
    return hashlib.sha256(code.encode()).hexdigest()


def light_picture(text: str) -> str:
    """A PNG in base64, in few colours, narrower until it is small enough."""
    from PIL import Image

    picture = Image.open(io.BytesIO(base64.b64decode(text))).convert("RGB")
    for width in WIDTHS:
        size = (min(width, picture.width), round(picture.height * min(1, width / picture.width)))
        smaller = picture.resize(size, Image.Resampling.LANCZOS).quantize(COLOURS)
        out = io.BytesIO()
        smaller.save(out, "PNG", optimize=True)
        found = base64.b64encode(out.getvalue()).decode("ascii")
        if len(found) <= MAX_PICTURE:
            break
    return found


def lighten(notebook) -> None:
    """Drop what changes from run to run, and make pictures light."""
    notebook.metadata.pop("widgets", None)
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type != "code":
            continue
        cell.outputs = [one for one in cell.outputs if one.get("name") != "stderr"]
        for output in cell.outputs:
            data = output.get("data", {})
            for kind in list(data):
                if kind not in KEPT:
                    del data[kind]
            if "image/png" in data:
                data["image/png"] = light_picture(data["image/png"])


def write(paths: list[Path]) -> None:
    """Execute notebooks and keep what they show."""
    from nbclient import NotebookClient

    for path in paths:
        notebook = nbformat.read(path, as_version=4)
        NotebookClient(
            notebook, timeout=900, resources={"metadata": {"path": path.parent}}
        ).execute()
        lighten(notebook)
        notebook.metadata["jaxsat"] = {"executed_code_sha256": code_hash(notebook)}
        nbformat.write(notebook, path)
        print(path.name, path.stat().st_size, "bytes", flush=True)


def problems(path: Path) -> list[str]:
    """What is wrong with the outputs of a notebook."""
    notebook = nbformat.read(path, as_version=4)
    found = []
    if notebook.metadata.get("jaxsat", {}).get("executed_code_sha256") != code_hash(notebook):
        found.append("its code is not what was executed")
    for number, cell in enumerate(notebook.cells):
        for output in cell.get("outputs", ()):
            if output.output_type == "error":
                found.append(f"cell {number} failed")
            if len(output.get("data", {}).get("image/png", "")) > MAX_PICTURE:
                found.append(f"a picture of cell {number} has more than {MAX_PICTURE} bytes")
    return [f"{path.name}: {one}; run docs/tools/notebooks.py --write {path.name}" for one in found]


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", action="store_true")
    what.add_argument("--check", action="store_true")
    parser.add_argument("names", nargs="*")
    given = parser.parse_args()
    paths = [FOLDER / name for name in given.names] or sorted(FOLDER.glob("*.ipynb"))
    if given.write:
        write(paths)
        return 0
    found = [one for path in paths for one in problems(path)]
    print("\n".join(found) or "outputs are fresh and light")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())

"""Run the tests that a change can affect, quick and slow, the nearest to the change first.

    python tests/affected.py                what differs from the last commit
    python tests/affected.py REVISION       what differs from that revision
    python tests/affected.py --list ...     only print what would run

A test is affected if it imports a changed module, or one that imports it however far away, if it
reads a changed file of another kind by its name, or if it mirrors a changed module. Pages and
notebooks that use a changed module are listed; notebooks are run.
"""

import argparse
import ast
import math
import re
import subprocess
import sys
from collections import deque
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
EVERYTHING = {
    *("pyproject.toml", "constraints.txt"),
    *("tests/conftest.py", "tests/helpers/typechecking.py"),
}
"""Files that every test depends on."""

DOTTED = re.compile(r"\bjaxsat(?:\.\w+)+")
COMMAND = re.compile(r"^\s*!|\"jaxsat\"", re.M)
"""In a notebook: the command line is run."""


class Selection:
    """What depends on what: modules of the package, files of tests, pages and notebooks."""

    def __init__(self, root: Path = ROOT):
        self.root = root
        self.graph = grimp.build_graph("jaxsat", exclude_type_checking_imports=True, cache_dir=None)
        self.modules = self.graph.modules

    @cached_property
    def public(self) -> dict[str, str]:
        """The module of each name that users import from `jaxsat`."""
        stub = ast.parse((self.root / "jaxsat/__init__.pyi").read_text(encoding="utf-8"))
        imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
        return {alias.name: str(node.module) for node in imports for alias in node.names}

    @cached_property
    def users(self) -> dict[str, set[str]]:
        """For each module and file of tests, by path, what imports it."""
        found: dict[str, set[str]] = {}
        for module in self.modules:
            for used in self.graph.find_modules_directly_imported_by(module):
                found.setdefault(self.path_of(used), set()).add(self.path_of(module))
        for file in sorted(self.root.glob("tests/**/*.py")):
            name = file.relative_to(self.root).as_posix()
            package = ".".join(file.relative_to(self.root).parts[:-1])
            for used in self.imports_of(file.read_text(encoding="utf-8"), package):
                found.setdefault(used, set()).add(name)
        return found

    def path_of(self, module: str) -> str:
        """The file of a module, relative to the root."""
        place = self.root / module.replace(".", "/")
        file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
        return file.relative_to(self.root).as_posix()

    def imports_of(self, code: str, package: str = "") -> set[str]:
        """The files that the code of a test or a notebook imports or names, by path."""
        found: set[str] = set()
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.Import):
                found |= {name for alias in node.names for name in self._files(alias.name)}
            elif isinstance(node, ast.ImportFrom):
                module = ".".join(filter(None, (package if node.level else "", node.module)))
                for alias in node.names:
                    found |= self._files(f"{module}.{alias.name}")
        for dotted in DOTTED.findall(code):
            found |= self._files(dotted)
        return found

    def _files(self, dotted: str) -> set[str]:
        parts = dotted.split(".")
        if parts[0] == "jaxsat" and len(parts) > 1 and parts[1] in self.public:
            return {self.path_of(self.public[parts[1]])}
        for end in range(len(parts), 0, -1):
            module = ".".join(parts[:end])
            if module in self.modules:
                return {self.path_of(module)} if module != "jaxsat" else set()
            stem = module.removeprefix("tests.").replace(".", "/")
            for file in (f"{stem}.py", f"{stem}/__init__.py"):
                for base in ("tests", "benchmarks"):
                    if (self.root / base / file).is_file():
                        return {f"{base}/{file}"}
        return set()

    def distances(self, changed: Iterable[str]) -> dict[str, int]:
        """All files that depend on changed ones, and over how many imports."""
        found = dict.fromkeys(changed, 0)
        waiting = deque(found)
        while waiting:
            file = waiting.popleft()
            for user in self.users.get(file, ()):
                if user not in found:
                    found[user] = found[file] + 1
                    waiting.append(user)
        return found

    def tests(self, changed: Iterable[str], within: float = math.inf) -> list[str]:
        """Files of tests that a change can affect over at most so many imports, nearest first."""
        changed = set(changed)
        every = {p.relative_to(self.root).as_posix() for p in self.root.glob("tests/**/test_*.py")}
        if changed & EVERYTHING:
            return sorted(every)
        near = changed | {name for file in changed for name in self._readers(file)}
        distances = self.distances(near)
        far = {name: distance for name, distance in distances.items() if distance <= within}
        mirrors = {self._mirror(file) for file in changed}
        for name in mirrors & every:
            far[name] = 0
        return sorted(every & far.keys(), key=lambda name: (far[name], name))

    def _mirror(self, file: str) -> str:
        path = Path(file.replace("jaxsat/", "tests/", 1))
        return path.with_name(f"test_{path.name}").as_posix()

    def _readers(self, file: str) -> set[str]:
        """What names a file that is no module, and tests of the package that reads its folder."""
        path = Path(file)
        if path.suffix == ".py" or path.parts[0] not in {"jaxsat", "docs", "README.md"}:
            return set()
        name = path.stem if path.suffix == ".toml" else path.name
        word = re.compile(rf"(?<![\w-]){re.escape(name)}(?![\w-])")
        files = [*self.root.glob("jaxsat/**/*.py"), *self.root.glob("tests/**/*.py")]
        texts = {p.relative_to(self.root).as_posix(): p.read_text(encoding="utf-8") for p in files}
        named = {name for name, text in texts.items() if word.search(text)}
        packages = (f"{parent.as_posix()}/__init__.py" for parent in path.parents)
        reader = next((one for one in packages if one in texts), "")
        return named | {user for user in self.users.get(reader, ()) if user.startswith("tests/")}

    def notebooks(self, changed: Iterable[str]) -> list[str]:
        """Notebooks that changed or use what did."""
        import nbformat

        changed = set(changed)
        far = self.distances(changed).keys()
        found = []
        for path in sorted(self.root.glob("notebooks/*.ipynb")):
            cells = nbformat.read(path, as_version=4).cells
            code = "\n".join(cell.source for cell in cells if cell.cell_type == "code")
            plain = re.sub(r"^\s*[!%].*$", "", code, flags=re.M)
            used = self.imports_of(plain)
            if COMMAND.search(code):
                used.add("jaxsat/cli/__init__.py")
            name = path.relative_to(self.root).as_posix()
            if name in changed or used & far:
                found.append(name)
        return found

    def pages(self, changed: Iterable[str]) -> list[str]:
        """Pages that name a changed module or its path: to be read again."""
        words = [name for file in changed for name in (file, file[:-3].replace("/", "."))]
        pages = [self.root / "README.md", *sorted(self.root.glob("docs/*.md"))]
        return [
            page.relative_to(self.root).as_posix()
            for page in pages
            if any(word in page.read_text(encoding="utf-8") for word in words)
        ]


def changed_files(revision: str) -> list[str]:
    """Files that differ from a revision, those not yet added included."""
    commands = (
        ["git", "diff", "--name-only", revision],
        ["git", "ls-files", "--others", "--exclude-standard"],
    )
    outputs = (
        subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for command in commands
    )
    return sorted({line for output in outputs for line in output.splitlines()})


def main() -> int:
    """Choose and run; gives the status of the last run that failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("revision", nargs="?", default="HEAD")
    parser.add_argument("--list", action="store_true", help="print the choice and run nothing")
    parser.add_argument("--within", type=float, default=math.inf, help="imports, at most")
    options = parser.parse_args()
    selection, changed = Selection(), changed_files(options.revision)
    tests = selection.tests(changed, options.within)
    notebooks = selection.notebooks(changed)
    print(f"{len(changed)} files changed; {len(tests)} files of tests, {len(notebooks)} notebooks")
    print(*tests, *notebooks, sep="\n")
    for page in selection.pages(changed):
        print(f"to be read again: {page}")
    if options.list:
        return 0
    pytest = [sys.executable, "-m", "pytest"]
    runs = []
    if tests:
        runs.append([*pytest, "-n", "2", "--dist", "loadgroup", "--durations=20", *tests])
    if notebooks:
        runs.append([*pytest, "--nbmake", "-p", "no:xdist", "-W", "default", *notebooks])
    return max([subprocess.run(run, cwd=ROOT, check=False).returncode for run in runs], default=0)


if __name__ == "__main__":
    sys.exit(main())

"""Names and comments of C files: identifiers from Python names, reserved words, safe comments."""

import ast
import re
import unicodedata
from collections.abc import Iterable, Iterator
from pathlib import Path

from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.trace import Element, Frame, Trace
from jaxsat.core.once import once
from jaxsat.core.package_files import data_of

_LETTERS = {
    "×": "x", "·": "*", "⊗": "(x)", "→": "->", "∫": "integral ", "Σ": "sum ", "√": "sqrt ",
    "²": "^2", "³": "^3", "⁻": "^-", "¹": "1", "ᵀ": "^T", "≤": "<=", "≥": ">=", "≈": "~",
    "−": "-", "–": "-", "—": "-", "…": "...", "“": '"', "”": '"', "’": "'", "∞": "infinity",
    "°": " deg", "±": "+-", "π": "pi", "∈": "in", "∂": "d", "₀": "0", "₁": "1", "₂": "2",
}  # fmt: skip


def ascii_text(text: str) -> str:
    """Convert text to ASCII: Greek letters by their names, other signs by the nearest one."""
    letters = []
    for letter in text:
        name = unicodedata.name(letter, "")
        if letter.isascii():
            letters.append(letter)
        elif letter in _LETTERS:
            letters.append(_LETTERS[letter])
        elif name.startswith("GREEK") and "LETTER" in name:
            word = name.split("LETTER ")[1].split()[0].lower()
            letters.append(word.capitalize() if "CAPITAL" in name else word)
        else:
            plain = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
            letters.append(plain or "?")
    return "".join(letters)


def comment(text: str, indent: str = "", width: int = 98) -> list[str]:
    """Return lines of one C comment; nothing in the text ends it or begins another one."""
    plain = ascii_text(" ".join(text.split())).replace("`", "")
    plain = "".join(letter for letter in plain if letter.isprintable())
    for sign, harmless in (("\\", "|"), ("/*", "/ *"), ("*/", "* /"), ("//", "/ /"), ("??", "? ?")):
        while sign in plain:
            plain = plain.replace(sign, harmless)
    lines, line = [], f"{indent}/*"
    for word in plain.split():
        if len(line) + len(word) + 4 > width and line.strip() not in ("/*", ""):
            lines.append(line)
            line = f"{indent}  "
        line += f" {word}"
    return [*lines, f"{line} */"]


def identifier(*parts: str) -> str:
    """Return a C identifier of words, in lower case with underscores."""
    text = "_".join(ascii_text(part) for part in parts)
    text = re.sub(r"(?<=[a-z0-9])(?=[A-Z][a-z])", "_", text)
    text = re.sub(r"[\W_]+", "_", text).strip("_").lower() or "x"
    return f"x_{text}" if text[0].isdigit() else text


COUNTERS = tuple("ijkmn")
"""Names of the counters of loops, from the innermost, which nothing else has."""

_LONGEST = 56
"""Largest number of characters of a name: C distinguishes 63, and a number may follow."""


class Names:
    """Identifiers in use in a scope, no two alike; `outer` is the file's scope."""

    def __init__(
        self, identifiers: Iterable[str] = (), *, fields: bool = False, outer: "Names | None" = None
    ):
        self.identifiers, self._fields = set(identifiers), fields
        self.outer, self.inside = outer, set[str]()
        self._last: dict[str, int] = {}

    def _is_taken(self, name: str) -> bool:
        """Whether a name has a meaning here, or would hide or be hidden by another one."""
        beyond = self.outer is not None and name in self.outer.identifiers
        means = name in WORDS if self._fields else is_reserved(name)
        return means or name in self.identifiers or name in self.inside or beyond

    def new(self, wish: str) -> str:
        """Return this identifier, with a number if it is in use; of a long one the end."""
        if not self._fields and len(wish) > _LONGEST:
            wish = wish[-_LONGEST:].split("_", 1)[-1].lstrip("0123456789_")
        if not self._fields and is_reserved(f"{wish}_2"):  # of a family whose names all are
            wish = f"x_{wish}"
        name = wish
        while self._is_taken(name):
            self._last[wish] = self._last.get(wish, 1) + 1
            name = f"{wish}_{self._last[wish]}"
        self.identifiers.add(name)
        if self.outer is not None:
            self.outer.inside.add(name)
        return name


def assigned_name(file: str, line: int) -> str | None:
    """Return the name that a Python statement gives its result, if it is a single one, or None."""
    statement = _statements(file).get(line)
    targets = statement.targets if isinstance(statement, ast.Assign) else []
    if len(targets) == 1 and isinstance(targets[0], ast.Name):
        return targets[0].id
    return None


@once
def _statements(file: str) -> dict[int, ast.stmt]:
    tree = _tree(file)
    if tree is None:
        return {}
    statements: dict[int, ast.stmt] = {}
    for node in ast.walk(tree):  # from the outermost
        if isinstance(node, ast.stmt):
            for line in range(node.lineno, (node.end_lineno or node.lineno) + 1):
                statements[line] = node
    return statements


def docstring(file: str, function: str) -> str:
    """The first paragraph that a Python function says of itself; `function` is its full name."""
    definition = _definition(file, function)
    text = ast.get_docstring(definition) if definition is not None else None
    return " ".join(text.split("\n\n")[0].split()) if text else ""


def line_of(file: str, function: str) -> int | None:
    """The line of a file in which a function of this full name is defined, None if it is not."""
    definition = _definition(file, function)
    return None if definition is None else definition.lineno


_Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def _definition(file: str, function: str) -> _Definition | None:
    body: list[ast.stmt] = _statements_of(file)
    definition = None
    for word in function.split("."):
        if word == "<locals>":
            continue
        inside = (node for node in _definitions(body) if node.name == word)
        definition = next(inside, None)
        if definition is None:
            return None
        body = definition.body
    return definition


def _definitions(body: Iterable[ast.stmt]) -> Iterator[_Definition]:
    """Yield functions and classes of a body, with those in branches and loops."""
    for node in body:
        if isinstance(node, _Definition):
            yield node
        else:
            yield from _definitions(
                x for x in ast.iter_child_nodes(node) if isinstance(x, ast.stmt)
            )


def _statements_of(file: str) -> list[ast.stmt]:
    tree = _tree(file)
    return [] if tree is None else tree.body


@once
def _tree(file: str) -> ast.Module | None:
    try:
        return ast.parse(Path(file).read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError):
        return None


_RESERVED = data_of("jaxsat.compiler.c", "reserved.toml")
WORDS, LIBRARY = (frozenset(_RESERVED[name].split()) for name in ("words", "library"))
"""Keywords and macros; names of the libraries."""

_OTHERS = re.compile(
    r"u?_?u?int\w*_t|(atomic|pthread|thrd|mtx|cnd|tss)_\w+"
    r"|f(32|64)x?(add|sub|mul|div|fma|sqrt)\w*|\w+_[fiub](8|16|32|64)|((read|write)_)?controller_\w+"
)
"""Patterns of integer types, families of functions, helpers, and an export's interface."""

_PRECISION = re.compile(r"(f|l|[fd](16|32|64|128)x?)(?=_r$|$)")
"""Suffixes of the names of functions for other types than doubles."""


def is_reserved(name: str) -> bool:
    """Whether a name is not allowed for a function, table or variable."""
    if name in COUNTERS or name in WORDS or name in LIBRARY or _OTHERS.fullmatch(name):
        return True
    return _PRECISION.sub("", name) in LIBRARY


def element_of(trace: Trace, value: Value) -> Element | None:
    """Return the array element that a value is, if it is computed where the array is."""
    element, places = trace.elements.get(value.number), trace.places.get(value.number, ())
    if element is None or not places or not element.place:
        return None
    here, there = places[-1], element.place[-1]
    same = here.function == there.function and here.file == there.file
    if same and assigned_name(here.file, here.line) == assigned_name(there.file, there.line):
        return element
    return None


def wish_of(frames: tuple[Frame, ...]) -> str:
    """Return the Python name of a value computed at a place."""
    for frame in reversed(frames):
        name = assigned_name(frame.file, frame.line) or frame.function.split(".")[-1]
        if not name.startswith("<"):
            return identifier(name)
    return "x"


def name_of(trace: Trace, x: Scalar, otherwise: str) -> str:
    """Return the Python name of the array of which a value is the first element."""
    if not isinstance(x, Value):
        return otherwise
    if x.number in trace.names:
        return trace.names[x.number]
    element = element_of(trace, x)
    frames = element.place if element is not None else trace.places.get(x.number, ())
    return wish_of(frames) if frames else otherwise

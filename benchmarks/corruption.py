"""Damage to the files of a folder, drawn from a seed, as disks, crashes and careless hands do it.

    python benchmarks/corruption.py FOLDER --seed 3

damages one file of a folder in one way and says which and how. `corrupt` does the same from Python;
`KINDS` are the ways. For campaigns that look what a program makes of it.
"""

import argparse
import json
import os
import random
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple


class Damage(NamedTuple):
    """What was done: the way, the file by its path in the folder, and details."""

    kind: str
    file: str
    detail: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.kind} {self.file} {self.detail}".rstrip()


def files_of(folder: Path) -> list[str]:
    """All plain files of a folder by their paths in it, in order."""
    return sorted(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink()
    )


def flip(folder: Path, name: str, rng: random.Random) -> str:
    """Turn one bit over."""
    data = bytearray((folder / name).read_bytes())
    if not data:
        return "nothing to turn"
    place, bit = rng.randrange(len(data)), rng.randrange(8)
    data[place] ^= 1 << bit
    (folder / name).write_bytes(data)
    return f"bit {bit} of byte {place}"


def truncate(folder: Path, name: str, rng: random.Random) -> str:
    """Keep the beginning alone."""
    size = (folder / name).stat().st_size
    kept = rng.randrange(size) if size else 0
    os.truncate(folder / name, kept)
    return f"to {kept} of {size} bytes"


def extend(folder: Path, name: str, rng: random.Random) -> str:
    """Append bytes."""
    count = rng.randint(1, 64)
    with (folder / name).open("ab") as file:
        file.write(rng.randbytes(count))
    return f"by {count} bytes"


def empty(folder: Path, name: str, rng: random.Random) -> str:
    """Leave the file without content, as a power cut may."""
    del rng
    os.truncate(folder / name, 0)
    return ""


def zero(folder: Path, name: str, rng: random.Random) -> str:
    """Put zeros in place of a stretch, as a disk that lost a block."""
    data = bytearray((folder / name).read_bytes())
    begin = rng.randrange(len(data)) if data else 0
    end = min(len(data), begin + rng.randint(1, 512))
    data[begin:end] = bytes(end - begin)
    (folder / name).write_bytes(data)
    return f"bytes {begin} to {end}"


def delete(folder: Path, name: str, rng: random.Random) -> str:
    """Remove the file."""
    del rng
    (folder / name).unlink()
    return ""


def copy_over(folder: Path, name: str, rng: random.Random) -> str:
    """Put a copy of another file of the folder in place, one beside it or alike if there is one."""
    other = _another(folder, name, rng)
    shutil.copyfile(folder / other, folder / name)
    return f"from {other}"


def swap(folder: Path, name: str, rng: random.Random) -> str:
    """Exchange the file with another one."""
    other = _another(folder, name, rng)
    one, two = (folder / name).read_bytes(), (folder / other).read_bytes()
    (folder / name).write_bytes(two)
    (folder / other).write_bytes(one)
    return f"with {other}"


def copy_to_new(folder: Path, name: str, rng: random.Random) -> str:
    """Copy the file to a name that is not there: that of the next chunk, if it has a number."""
    path = Path(name)
    parts = [*path.parts]
    numbers = [place for place, part in enumerate(parts) if part.isdecimal()]
    if numbers:
        place = numbers[0]
        parts[place] = str(int(parts[place]) + rng.randint(1, 3))
    else:
        parts[-1] = f"{path.stem}-{rng.randrange(100)}{path.suffix}"
    target = folder.joinpath(*parts)
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / name, target)
    return f"to {'/'.join(parts)}"


def make_folder(folder: Path, name: str, rng: random.Random) -> str:
    """Put a folder in the file's place."""
    del rng
    (folder / name).unlink()
    (folder / name).mkdir()
    return ""


def edit_json(folder: Path, name: str, rng: random.Random) -> str:
    """Change one value of a file of JSON, or take one away; a bit elsewhere."""
    try:
        data = json.loads((folder / name).read_bytes())
    except (ValueError, RecursionError):
        return flip(folder, name, rng)
    whole: Any = [data]
    holder, key = whole, 0
    while isinstance(holder[key], (dict, list)) and holder[key] and rng.random() < 0.85:
        holder = holder[key]
        key = rng.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
    before = json.dumps(holder[key])[:40]
    values: list[Any] = [None, [], {}, "", "x", 0, -1, 10**12, 1e308, True, [holder[key]]]
    if isinstance(holder, dict) and rng.random() < 0.2:
        del holder[key]
        after = "nothing"
    else:
        if isinstance(holder[key], int):
            values += [holder[key] + 1, holder[key] * 7]
        holder[key] = rng.choice(values)
        after = json.dumps(holder[key])[:40]
    (folder / name).write_text(json.dumps(whole[0]), encoding="utf-8")
    return f"{key}: {before} to {after}"


KINDS: dict[str, Callable[[Path, str, random.Random], str]] = {
    "flip": flip,
    "truncate": truncate,
    "extend": extend,
    "empty": empty,
    "zero": zero,
    "delete": delete,
    "copy": copy_over,
    "swap": swap,
    "copy-to-new": copy_to_new,
    "folder": make_folder,
    "edit": edit_json,
}


def corrupt(folder: Path, seed: int, kinds: Sequence[str] = tuple(KINDS)) -> Damage:
    """Damage one file of a folder in one of these ways; the same seed does the same."""
    rng = random.Random(seed)
    kind = rng.choice(list(kinds))
    files = files_of(folder)
    if kind == "edit":
        files = [name for name in files if name.endswith(".json")] or files
    name = rng.choice(files)
    return Damage(kind, name, KINDS[kind](folder, name, rng))


def _another(folder: Path, name: str, rng: random.Random) -> str:
    others = [other for other in files_of(folder) if other != name]
    alike = [other for other in others if other.split("/")[0] == name.split("/")[0]]
    return rng.choice(alike or others or [name])


def main() -> None:
    """Damage a folder once."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--kinds", default=",".join(KINDS))
    options = parser.parse_args()
    print(corrupt(options.folder, options.seed, options.kinds.split(",")))


if __name__ == "__main__":
    main()

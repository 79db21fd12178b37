"""Machine code on disk: found again, whole or not at all, and ours alone."""

import os
import stat
import warnings
from pathlib import Path

import pytest

from jaxsat.compiler import Mapped
from jaxsat.compiler.llvm import cache, target
from jaxsat.compiler.llvm import cache as private

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no owners and modes")
TEXT = "define void @nothing() {\nret void\n}\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXSAT_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(cache, "_told", cache.threading.Event())
    return tmp_path / "native"


@pytest.fixture
def made(monkeypatch):
    """What is made, not found: LLVM has its own tests."""
    texts = []

    def make(text):
        texts.append(text)
        return f"code of {text}".encode()

    monkeypatch.setattr(target, "object_code", make)
    return texts


def entries(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.o"))


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_code_is_kept_and_found_again(folder, made):
    code = cache.object_code(TEXT)
    assert cache.object_code(TEXT) == code
    assert made == [TEXT]
    assert len(entries(folder)) == 1


def test_constants_tell_programs_apart(folder):
    texts = [Mapped(lambda x, _, n=n: n * x, 0.0).text for n in (2.0, 3.0)]
    assert len({cache.object_code(text) for text in texts}) == len(entries(folder)) == 2


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_nobody_else_can_read_or_write_any_of_it(folder, made, umask):
    before = os.umask(umask)
    try:
        cache.object_code(TEXT)
    finally:
        os.umask(before)
    assert mode(folder) == 0o700
    assert [mode(path) for path in folder.iterdir()] == [0o600]


def shortened(entry: Path) -> None:
    entry.write_bytes(entry.read_bytes()[:-7])


def with_a_bit_flipped(entry: Path) -> None:
    content = bytearray(entry.read_bytes())
    content[40] ^= 1
    entry.write_bytes(content)


def emptied(entry: Path) -> None:
    entry.write_bytes(b"")


def of_another_name(entry: Path) -> None:
    other = cache.object_code(TEXT + "\n")
    (found,) = (e for e in entries(entry.parent) if e.read_bytes().endswith(other))
    os.replace(found, entry)


def linked(entry: Path) -> None:
    content = entry.read_bytes()
    entry.unlink()
    (entry.parent.parent / "target").write_bytes(content)
    entry.symlink_to(entry.parent.parent / "target")


def a_pipe(entry: Path) -> None:
    entry.unlink()
    os.mkfifo(entry)


def readable_by_all(entry: Path) -> None:
    entry.chmod(0o644)


@pytest.mark.parametrize(
    "change",
    [
        shortened, with_a_bit_flipped, emptied, of_another_name, linked, a_pipe, readable_by_all,
    ],
)  # fmt: skip
def test_an_entry_that_may_not_be_ours_is_made_again(folder, made, change):
    code = cache.object_code(TEXT)
    (entry,) = entries(folder)
    change(entry)
    made.clear()
    assert cache.object_code(TEXT) == code
    assert made == [TEXT]
    assert cache.object_code(TEXT) == code
    assert made == [TEXT]
    assert not list(folder.glob(private.NEW + "*"))


def test_a_link_is_replaced_and_its_target_left_alone(folder, made):
    cache.object_code(TEXT)
    target_file = folder.parent / "mine"
    target_file.write_text("mine")
    for path in entries(folder):
        path.unlink()
        path.symlink_to(target_file)
    cache.object_code(TEXT)
    assert target_file.read_text() == "mine"
    assert not any(path.is_symlink() for path in folder.iterdir())


def test_what_killed_writers_left_goes_after_a_while(folder, made):
    cache.object_code(TEXT)
    for name, age in ((".new-old", 2 * private.ABANDONED), (".new-now", 0)):
        (folder / name).write_text("half")
        then = (folder / name).stat().st_mtime - age
        os.utime(folder / name, (then, then))
    cache.object_code(TEXT + "\n")
    assert [path.name for path in folder.glob(private.NEW + "*")] == [".new-now"]


def test_the_entries_unused_for_longest_go(folder, made, monkeypatch):
    size = cache._BYTES + len(f"code of {TEXT}")
    monkeypatch.setattr(cache, "MOST_BYTES", int(3.5 * size))
    for number in range(5):
        cache.object_code(TEXT + "\n" * number)
        for entry in entries(folder):
            os.utime(entry, (entry.stat().st_atime, entry.stat().st_mtime - 10))
    made.clear()
    for number in (4, 3, 2):
        cache.object_code(TEXT + "\n" * number)
    assert len(entries(folder)) == 3
    assert not made


def a_file(folder: Path) -> None:
    folder.write_text("mine")


def a_link(folder: Path) -> None:
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to(folder.parent / "elsewhere")


def open_to_all(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)


def in_a_folder_open_to_all(folder: Path) -> None:
    folder.parent.chmod(0o777)


def of_another(folder: Path) -> None:
    folder.mkdir(mode=0o700)
    os.chown(folder, 12345, 12345)


def in_a_folder_of_another(folder: Path) -> None:
    os.chown(folder.parent, 12345, 12345)


def a_folder_for_an_entry(folder: Path) -> None:
    cache.object_code(TEXT)
    (entry,) = entries(folder)
    entry.unlink()
    entry.mkdir()


root = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs root")


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        (a_file, "File exists"),
        (a_link, "not a folder"),
        (open_to_all, "can be written by other users"),
        (in_a_folder_open_to_all, "can be written by other users"),
        (a_folder_for_an_entry, "Is a directory"),
        pytest.param(of_another, "belongs to another user", marks=root),
        pytest.param(in_a_folder_of_another, "belongs to another user", marks=root),
    ],
)
def test_a_cache_that_cannot_be_used_is_told_once(folder, made, obstacle, words):
    obstacle(folder)
    before = sorted(path.name for path in folder.parent.rglob("*.o"))
    with pytest.warns(cache.CacheWarning, match=words) as told:
        assert cache.object_code(TEXT) == f"code of {TEXT}".encode()
    assert cache.object_code(TEXT)  # warnings are errors here: nothing more is told
    assert len(told) == 1
    assert "\n" not in str(told[0].message)
    assert sorted(path.name for path in folder.parent.rglob("*.o")) == before


def test_a_full_disk_is_told_once_and_leaves_nothing(folder, made, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device", "somewhere")

    monkeypatch.setattr(private.os, "replace", full)
    with pytest.warns(cache.CacheWarning, match="somewhere: No space left") as told:
        assert cache.object_code(TEXT)
    assert cache.object_code(TEXT)
    assert len(told) == 1
    assert list(folder.iterdir()) == []


def test_a_folder_that_others_may_read_is_closed(folder, made):
    folder.mkdir()
    folder.chmod(0o755)
    cache.object_code(TEXT)
    assert mode(folder) == 0o700


def test_a_sticky_folder_above_is_as_good_as_ones_own(folder, made):
    folder.parent.chmod(0o1777)
    cache.object_code(TEXT)
    assert entries(folder)


@pytest.mark.parametrize("given", [None, "", "relative", "./here"])
def test_only_an_absolute_cache_home_counts(given, monkeypatch, tmp_path):
    monkeypatch.setattr(cache.sys, "platform", "linux")
    monkeypatch.delenv("JAXSAT_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if given is not None:
        monkeypatch.setenv("XDG_CACHE_HOME", given)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache.folder() == tmp_path / ".cache" / "jaxsat" / "native"


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("HOME", "", "HOME"),
        ("HOME", "here", "HOME"),
        ("HOME", None, "no home folder"),
        ("JAXSAT_CACHE_DIR", "here", "JAXSAT_CACHE_DIR must be an absolute path"),
    ],
)
def test_without_an_absolute_path_there_is_no_cache_but_a_word(
    name, value, words, made, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cache, "_told", cache.threading.Event())
    for variable in ("JAXSAT_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable, raising=False)
    if value is None:
        monkeypatch.delenv(name)
        monkeypatch.setattr(os, "getuid", lambda: 4_000_000)  # as in a container: nobody's number
    else:
        monkeypatch.setenv(name, value)
    with pytest.warns(cache.CacheWarning, match=words):
        assert cache.object_code(TEXT)
    assert list(tmp_path.iterdir()) == []


def test_writers_at_once_do_not_disturb_one_another(folder, made):
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(8) as pool:
        codes = list(pool.map(cache.object_code, [TEXT] * 40))
    assert set(codes) == {f"code of {TEXT}".encode()}
    made.clear()
    cache.object_code(TEXT)
    assert made == []


def test_the_command_line_shows_it_as_one_line(capsys, monkeypatch):
    from jaxsat.cli import app

    def command(_):
        warnings.simplefilter("default")
        warnings.warn("no cache", cache.CacheWarning, stacklevel=1)
        return 0

    monkeypatch.setattr(app, "_command", command)
    app.run([])
    assert capsys.readouterr().err == "warning: no cache\n"

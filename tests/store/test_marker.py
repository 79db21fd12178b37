"""The marker of an output folder: only what jaxsat wrote, unchanged, is replaced."""

import pytest

from jaxsat.store import folder as module
from jaxsat.store.folder import MARKER, OutputError, OutputFolder
from jaxsat.store.marker import Marker, UnverifiedWarning, read_unchanged, remove_folder
from jaxsat.store.resumable import ResumableFolder
from store.folders import names, write


def test_never_replaces_what_others_wrote(tmp_path):
    target = tmp_path / "out"
    write(target, "old")
    (target / "thesis.tex").write_text("years of work")
    with pytest.raises(OutputError, match=r"did not write.*\(thesis\.tex\)"):
        OutputFolder(target, overwrite=True)
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "data.txt").write_text("x")
    with pytest.raises(OutputError, match="did not write"):
        OutputFolder(foreign, overwrite=True)
    (foreign / MARKER).write_text("[]")
    with pytest.raises(OutputError, match="did not write"):
        OutputFolder(foreign, overwrite=True)


def one_of_many_files(target):
    with OutputFolder(target, overwrite=True) as folder:
        folder.write("run.json", "{}")
        folder.path.joinpath("more").mkdir()
        folder.path.joinpath("more", "figure.png").write_bytes(b"picture")


def edit(target):
    (target / "run.json").write_text("edited by hand")


def add(target):
    (target / "notes.txt").write_text("of the user")


def add_below(target):
    (target / "more" / "thesis.tex").write_text("years of work")


def folder_of_a_listed_name(target):
    (target / "run.json").unlink()
    (target / "run.json").mkdir()
    (target / "run.json" / "thesis.tex").write_text("years of work")


def empty_folder(target):
    (target / "for later").mkdir()


def longer_marker(target):
    with (target / MARKER).open("a") as file:
        file.write("notes of the user\n")


def another_marker(target):
    one_of_many_files(target.parent / "another")
    (target.parent / "another" / MARKER).replace(target / MARKER)
    (target / "run.json").write_text("of the user")


@pytest.mark.parametrize(
    "change",
    [
        edit,
        add,
        add_below,
        folder_of_a_listed_name,
        empty_folder,
        longer_marker,
        another_marker,
    ],
)
def test_only_what_is_proven_to_be_unchanged_is_replaced(tmp_path, change):
    target = tmp_path / "out"
    one_of_many_files(target)
    one_of_many_files(target)
    change(target)
    before = {path: path.is_file() and path.read_bytes() for path in target.rglob("*")}
    with pytest.raises(OutputError, match="did not write, or what was changed since"):
        one_of_many_files(target)
    assert before == {path: path.is_file() and path.read_bytes() for path in target.rglob("*")}


def test_a_link_in_the_place_of_a_file_is_not_ours(tmp_path):
    target = tmp_path / "out"
    one_of_many_files(target)
    (tmp_path / "mine").write_text("{}")  # even with the same content
    (target / "run.json").unlink()
    (target / "run.json").symlink_to(tmp_path / "mine")
    with pytest.raises(OutputError, match=r"run\.json"):
        one_of_many_files(target)
    assert (target / "run.json").is_symlink()


def test_a_result_is_replaced_only_by_one_of_its_kind(tmp_path):
    write(tmp_path / "run", kind="run")
    with pytest.raises(OutputError, match=r"another kind.*\(run, not figures\).*with --figures"):
        OutputFolder(tmp_path / "run", kind="figures", overwrite=True, option="--figures")
    write(tmp_path / "run", "newer", kind="run", overwrite=True)
    assert (tmp_path / "run" / "data.txt").read_text() == "newer"


def test_what_comes_to_a_folder_at_the_last_moment_is_kept(tmp_path, monkeypatch):
    target = tmp_path / "out"
    write(target, "old")
    plain = module._swap

    def late(one, other):
        (other / "thesis.tex").write_text("years of work")
        plain(one, other)

    monkeypatch.setattr(module, "_swap", late)
    with pytest.raises(OutputError, match=r"thesis.tex\) was kept in"):
        write(target, "new", overwrite=True)
    assert (target / "data.txt").read_text() == "new"
    (kept,) = tmp_path.glob(".out.partial-*")
    assert (kept / "thesis.tex").read_text() == "years of work"
    assert (kept / "data.txt").read_text() == "old"


def test_stranger_that_comes_while_computing_is_kept(tmp_path):
    target = tmp_path / "out"
    write(target, "old")

    def work():
        with OutputFolder(target, overwrite=True) as folder:
            (folder.path / "data.txt").write_text("new")
            (target / "thesis.tex").write_text("years of work")

    with pytest.raises(OutputError, match="did not write"):
        work()
    assert (target / "thesis.tex").read_text() == "years of work"
    assert (target / "data.txt").read_text() == "old"


OF_FILE_MANAGERS = {
    ".DS_Store": b"\0",
    "Thumbs.db": b"\0",
    "desktop.ini": b"\0",
    "Desktop.ini": b"\0",
    "Icon\r": b"",
    "._a.txt": b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X",
    "__MACOSX/out/._a.txt": b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X",
    ".AppleDouble/a.txt": b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X",
    "@eaDir/rates.png/SYNOPHOTO_THUMB_S.png": b"\x89PNG",
    "@eaDir/a.txt@SynoEAStream": b"\0",
}


def place(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


@pytest.mark.parametrize(("name", "content"), OF_FILE_MANAGERS.items(), ids=OF_FILE_MANAGERS)
def test_what_file_managers_leave_is_no_obstacle(tmp_path, name, content):
    folder = tmp_path / "made"
    folder.mkdir()
    marker = Marker.make(folder, "run", {})
    marker.write("a.txt", b"a")
    place(folder / name, content)
    assert marker.foreign_files() == []
    assert remove_folder(folder) == []
    assert not folder.exists()


def replace(target):
    write(target, overwrite=True)


def resume(target):
    with ResumableFolder(target, "tuning", {}) as folder:
        folder.write("data.txt", b"new")


@pytest.mark.parametrize("work", [replace, resume])
def test_a_folder_that_holds_only_what_file_managers_leave_counts_as_empty(tmp_path, work):
    target = tmp_path / "out"
    target.mkdir()
    for name, content in OF_FILE_MANAGERS.items():
        place(target / name, content)
    work(target)
    assert names(target) == [MARKER, "data.txt"]
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("work", [replace, resume])
def test_what_is_beside_or_only_called_like_the_files_of_file_managers_is_kept(tmp_path, work):
    target = tmp_path / "out"
    target.mkdir()
    (target / ".DS_Store").write_bytes(b"\0")
    (target / "Thumbs.db").mkdir()
    (target / "._notes").write_text("mine")
    (target / "__MACOSX").mkdir()
    (target / "__MACOSX" / "notes").write_text("mine")
    with pytest.raises(OutputError, match="did not write"):
        work(target)
    assert (target / "__MACOSX" / "notes").exists()
    assert names(target) == [".DS_Store", "._notes", "Thumbs.db", "__MACOSX"]


def test_a_file_that_is_only_called_like_those_of_macos_is_kept(tmp_path):
    folder = tmp_path / "made"
    folder.mkdir()
    Marker.make(folder, "run", {})
    (folder / "._notes").write_text("mine")
    assert remove_folder(folder) == ["._notes"]
    assert (folder / "._notes").read_text() == "mine"


def test_a_damaged_marker_vouches_for_no_file(tmp_path):
    target = tmp_path / "out"
    one_of_many_files(target)
    assert read_unchanged(target / "run.json") == b"{}"
    marker = target / MARKER
    sound = marker.read_bytes()
    for damaged in (sound[:-20], sound.replace(b'"run.json"', b'"sun.json"'), b"", b"[]"):
        marker.write_bytes(damaged)
        with pytest.raises(OutputError, match=r"\.jaxsat was damaged"):
            read_unchanged(target / "run.json")
    marker.write_text('{"written_by": "jaxsat", "format": 1}')  # of an earlier version
    with pytest.warns(UnverifiedWarning, match="not verified"):
        assert read_unchanged(target / "run.json") == b"{}"

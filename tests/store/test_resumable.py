"""Folders that a command goes on with: the user's files stay, damaged ones are not used."""

import json

import pytest

from jaxsat.store import marker as module
from jaxsat.store.files import OutputError
from jaxsat.store.folder import OutputFolder
from jaxsat.store.marker import MARKER, Marker
from jaxsat.store.resumable import ResumableFolder
from jaxsat.store.store import StudyStore


def opened(path, kind="tuning", **about):
    return ResumableFolder(path, kind, about)


@pytest.fixture
def run(tmp_path):
    with opened(tmp_path / "run", seed=1) as folder:
        folder.write("state", b"one")
        folder.write("bounds/20.json", "{}")
    return tmp_path / "run"


def contents(path):
    return {one: one.is_file() and one.read_bytes() for one in path.rglob("*")}


def test_what_was_written_is_read_and_replaced(run):
    with opened(run, seed=2) as folder:
        assert folder.about == {"seed": 1}
        assert folder.read("state") == b"one"
        assert folder.read("nothing") is None
        folder.write("state", b"two")
        folder.write("state", b"three")
        assert folder.is_complete("state")
        assert not folder.is_complete("summary")
    with opened(run) as folder:
        assert folder.read("state") == b"three"
        (run / "bounds" / "20.json").unlink()
        assert not folder.is_complete("state")


@pytest.mark.parametrize("name", ["state", "bounds/20.json"])
@pytest.mark.parametrize("content", [b"", b"onf", b"one more"])
def test_what_was_changed_is_neither_used_nor_replaced(run, name, content):
    (run / name).write_bytes(content)
    before = contents(run)
    with pytest.raises(OutputError, match=f"{name} was damaged, or changed, since jaxsat wrote it"):
        opened(run)
    assert contents(run) == before
    (run / name).unlink()
    with opened(run) as folder:
        assert folder.read(name) is None


def test_what_changes_while_it_is_open_is_not_replaced_either(run):
    with opened(run) as folder:
        (run / "state").write_bytes(b"by hand")
        for attempt in (lambda: folder.read("state"), lambda: folder.write("state", b"new")):
            with pytest.raises(OutputError, match="was damaged, or changed"):
                attempt()
    assert (run / "state").read_bytes() == b"by hand"


def test_a_file_of_the_users_is_not_overwritten(run):
    (run / "summary.md").write_text("my summary")
    with opened(run) as folder:
        with pytest.raises(OutputError, match=r"summary\.md was damaged, or changed"):
            folder.write("summary.md", "ours")
        folder.write("other.md", "ours")
    assert (run / "summary.md").read_text() == "my summary"


def test_links_are_not_followed(run, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    for name in (".state.partial", "summary.md"):
        (run / name).symlink_to(tmp_path / "thesis.tex")
    with opened(run) as folder:
        folder.write("state", b"two")
        with pytest.raises(OutputError, match="was damaged, or changed"):
            folder.write("summary.md", b"ours")
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_folders_of_anything_else_are_refused(tmp_path):
    users = tmp_path / "users"
    (users / "studies").mkdir(parents=True)
    (users / "comparison.png").write_bytes(b"of the user")
    with OutputFolder(tmp_path / "figures", kind="figures") as made:
        made.write("a.png", b"x")
    StudyStore(tmp_path / "s", {}, {}, 1, 1).close()
    (tmp_path / "file").touch()
    for name in ("users", "figures", "s", "file"):
        before = contents(tmp_path)
        with pytest.raises(OutputError, match=r"did not write|another kind|is a file"):
            opened(tmp_path / name, "comparison")
        assert contents(tmp_path) == before


def test_one_writer_at_a_time_and_a_marker_that_is_damaged(run):
    with opened(run), pytest.raises(OutputError, match="another process"):
        opened(run)
    content = (run / MARKER).read_bytes()
    for place in range(0, len(content), 7):
        (run / MARKER).write_bytes(
            content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]
        )
        with (
            pytest.raises(OutputError, match=r"did not write|was damaged, or changed"),
            opened(run) as folder,
        ):
            for name in ("state", "bounds/20.json"):
                folder.write(name, content)
        (run / "state").write_bytes(b"one")


def test_what_a_killed_process_left_is_removed_and_a_new_folder_without_results(run):
    marker = Marker.read(run)
    assert marker is not None
    marker.write("late", b"x")
    partial = json.loads((run / MARKER).read_bytes())["partial"]
    (run / partial).write_bytes(b"half")
    users = run / ".jaxsat-0123456789abcdef.partial"
    users.write_bytes(b"of the user")
    opened(run).close()
    assert not (run / partial).exists()
    assert users.exists()
    with pytest.raises(KeyError), opened(run.parent / "new"):
        raise KeyError
    assert not (run.parent / "new").exists()


def test_a_write_that_was_broken_off_leaves_the_old_content_known(run, monkeypatch):
    """However often that happens; what was there before is known until it is replaced."""
    plain = module.write_file

    def fail(path, *arguments, **options):
        if path.name == "state":
            raise OSError(28, "No space left on device")
        plain(path, *arguments, **options)

    for content in (b"two", b"three"):
        with opened(run) as folder:
            monkeypatch.setattr(module, "write_file", fail)
            with pytest.raises(OutputError, match="No space left on device"):
                folder.write("state", content)
            monkeypatch.undo()
            assert folder.read("state") == b"one"
    with opened(run) as folder:
        folder.write("state", b"four")
        folder.write("state", b"five")
    (run / "state").write_bytes(b"two")
    with pytest.raises(OutputError, match="was damaged, or changed"):
        opened(run)


@pytest.mark.parametrize("change", [{"hashes": {"../x": ["a"]}}, {"partial": "../x"}, {"more": 1}])
def test_a_marker_of_another_form_is_none(run, change):
    """Even one whose hash is right."""
    document = json.loads((run / MARKER).read_bytes())
    document.pop("check")
    document |= change
    check = module._check(document)
    (run / MARKER).write_text(json.dumps({**document, "check": check}))
    assert Marker.read(run) is None

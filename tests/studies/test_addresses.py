"""Where a scheduler is: what is an address, what is its file, and how long either is waited for."""

import json
import os
import threading
import time

import pytest

from jaxsat.studies.connection import MAX_FILE_SIZE, scheduler_address

PLACES = ["tcp://host:8786", "tls://10.0.0.1:8786", "host:8786", "[::1]:8786", "inproc://a/1/2"]


@pytest.mark.parametrize("place", PLACES)
def test_addresses_are_taken_as_they_are_and_from_files(tmp_path, place):
    assert scheduler_address(place, 0.0) == place
    file = tmp_path / "s.json"
    file.write_text(json.dumps({"type": "Scheduler", "address": place, "workers": {}}))
    assert scheduler_address(str(file), 0.0) == place


@pytest.mark.parametrize(
    "place", ["", " ", "host", "tcp://", "ho st:1", "host:", "\x1b[2J", "a" * 9999]
)
def test_what_is_neither_is_refused(place):
    with pytest.raises(ValueError, match="must be an address such as tcp://host:8786") as caught:
        scheduler_address(place, 10.0)
    assert "\x1b" not in str(caught.value)


CONTENTS = {
    "empty": (b"", "must be JSON"),
    "garbage": (b"{nonsense", "must be JSON"),
    "binary": (bytes(range(256)), "must be the JSON that a scheduler wrote"),
    "deep": (b"[" * 200_000, "must be the JSON that a scheduler wrote"),
    "digits": (b"1" * 5000, "must be the JSON that a scheduler wrote"),
    "list": (b"[1]", "must have the key `address`"),
    "number": (b'{"address": 5}', "must have the key `address`"),
    "other": (b'{"key": "tcp://host:1"}', "must have the key `address`"),
    "place": (b'{"address": "/tmp/x"}', "must have the key `address`"),
    "large": (b" " * (MAX_FILE_SIZE + 1), "must be of at most"),
}


@pytest.mark.parametrize("kind", CONTENTS)
def test_files_of_others_are_refused(tmp_path, monkeypatch, kind):
    monkeypatch.setattr("jaxsat.studies.connection.FLUSHED_S", 0.0)
    content, message = CONTENTS[kind]
    file = tmp_path / "s.json"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=f"s.json' cannot be used: it {message}"):
        scheduler_address(str(file), 10.0)


@pytest.mark.parametrize("kind", ["folder", "fifo", "device"])
def test_what_is_no_file_is_refused(tmp_path, kind):
    place = tmp_path / "s.json"
    if kind == "folder":
        place.mkdir()
    elif kind == "fifo":
        getattr(os, "mkfifo", lambda _: pytest.skip("needs FIFOs"))(place)
    else:
        place.symlink_to(os.devnull)
    with pytest.raises(ValueError, match="must be a regular file"):
        scheduler_address(str(place), 10.0)


def test_a_file_that_nobody_writes_is_waited_for_as_long_as_said(tmp_path):
    begun = time.monotonic()
    with pytest.raises(ValueError, match=r"there is none after 0\.3 s"):
        scheduler_address(str(tmp_path / "s.json"), 0.3)
    assert time.monotonic() - begun < 3.0


def test_a_file_that_is_written_late_and_in_parts_is_read(tmp_path):
    file, text = tmp_path / "s.json", json.dumps({"address": "tcp://host:8786"})

    def write():
        time.sleep(0.2)
        with file.open("w") as stream:
            for half in (text[:9], text[9:]):
                stream.write(half)
                stream.flush()
                time.sleep(0.2)

    writer = threading.Thread(target=write)
    writer.start()
    assert scheduler_address(str(file), 30.0) == "tcp://host:8786"
    writer.join()

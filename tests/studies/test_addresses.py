"""Where a scheduler is: what is an address, what is its file, and how long either is waited for."""

import json
import os
import threading
import time

import pytest

from jaxsat.studies.connection import scheduler_address

PLACES = ["tcp://host:8786", "tls://10.0.0.1:8786", "host:8786", "[::1]:8786", "inproc://a/1/2"]


@pytest.mark.parametrize("place", PLACES)
def test_addresses_are_taken_as_they_are_and_from_files(tmp_path, place):
    assert scheduler_address(place, 0.0) == place
    file = tmp_path / "s.json"
    file.write_text(json.dumps({"type": "Scheduler", "address": place, "workers": {}}))
    assert scheduler_address(str(file), 0.0) == place
    link = tmp_path / "link.json"
    link.symlink_to(file)
    assert scheduler_address(str(link), 0.0) == place


@pytest.mark.parametrize(
    "place", ["", " ", "host", "tcp://", "ho st:1", "host:", "\x1b[2J", "a" * 9999]
)
def test_what_is_neither_is_refused(place):
    with pytest.raises(ValueError, match="must be an address such as tcp://host:8786") as caught:
        scheduler_address(place, 10.0)
    assert "\x1b" not in str(caught.value)


CONTENTS = {
    "empty": b"",
    "garbage": b"{nonsense",
    "binary": bytes(range(256)),
    "deep": b"[" * 200_000,
    "digits": b"1" * 5000,
    "list": b"[1]",
    "number": b'{"address": 5}',
    "other": b'{"key": "tcp://host:1"}',
    "place": b'{"address": "/tmp/x"}',
}


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr("jaxsat.studies.connection.FLUSHED_S", 0.0)


@pytest.mark.parametrize("kind", CONTENTS)
def test_files_of_others_are_refused(tmp_path, impatient, kind):
    file = tmp_path / "s.json"
    file.write_bytes(CONTENTS[kind])
    with pytest.raises(ValueError, match=r"s\.json' cannot be used: it must have the key"):
        scheduler_address(str(file), 10.0)


@pytest.mark.parametrize("kind", ["folder", "fifo", "device"])
def test_what_is_no_file_is_refused(tmp_path, impatient, kind):
    place = tmp_path / "s.json"
    if kind == "folder":
        place.mkdir()
    elif kind == "fifo":
        getattr(os, "mkfifo", lambda _: pytest.skip("needs FIFOs"))(place)
    else:
        place.symlink_to(os.devnull)
    with pytest.raises(ValueError, match="must have the key `address`"):
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

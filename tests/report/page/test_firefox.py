"""Pages in Firefox, by its own WebDriver BiDi port: they open, without an error or a request."""

import asyncio
import json
import subprocess

import numpy as np
import pytest

from helpers.pages import run_dataset
from helpers.tools import executable, needs

BROWSER = executable("firefox")
PORT = "WebDriver BiDi listening on "

pytestmark = [
    pytest.mark.slow,
    needs("firefox"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]

MOVE = """(() => {
  const slider = document.querySelector(".replay input[type=range]");
  slider.value = 5;
  slider.dispatchEvent(new Event("input"));
  return document.querySelector(".stage").dataset.quaternion;
})()"""


async def visit(port, address):
    """Open an address; gives the attitude at 5 s, and all that Firefox has to say against it."""
    websocket = pytest.importorskip("tornado.websocket")
    told, calls = [], iter(range(1, 10_000))
    wire = await websocket.websocket_connect(f"{port}/session", max_message_size=2**27)

    async def call(method, **params):
        number = next(calls)
        await wire.write_message(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            answer = json.loads(await wire.read_message())
            if answer.get("id") == number:
                return answer["result"]
            told.append(answer)

    async def value(expression):
        target = {"context": context}
        found = await call(
            "script.evaluate", expression=expression, target=target, awaitPromise=False
        )
        return found["result"].get("value")

    await call("session.new", capabilities={})
    events = ["log.entryAdded", "network.beforeRequestSent"]
    await call("session.subscribe", events=events)
    context = (await call("browsingContext.getTree"))["contexts"][0]["context"]
    told.clear()
    await call("browsingContext.navigate", context=context, url=address, wait="complete")
    for _ in range(120):
        if await value("document.documentElement.dataset.ready") == "true":
            break
        await asyncio.sleep(0.5)
    found = json.loads(await value(MOVE))
    await call("browser.close")
    wire.close()
    while await wire.read_message() is not None:
        pass
    return found, [text for one in told for text in complaints(one)]


def complaints(event):
    told = event.get("params", {})
    if event.get("method") == "log.entryAdded" and told["level"] in ("error", "warn"):
        yield told["text"]
    if event.get("method") == "network.beforeRequestSent":
        url = told["request"]["url"]
        if not url.startswith(("file:", "data:", "blob:")):
            yield url


def test_a_page_opens_and_its_slider_turns_the_body(page, tmp_path):
    file = tmp_path / "report.html"
    file.write_text(page, encoding="utf-8")
    options = ("--headless", "--no-remote", "--remote-debugging-port", "0")
    profile = tmp_path / "profile"
    profile.mkdir()
    with subprocess.Popen(
        [BROWSER, *options, "--profile", str(profile)], stderr=subprocess.PIPE, text=True
    ) as firefox:
        try:
            line = next(line for line in firefox.stderr if PORT in line)
            port = line.partition(PORT)[2].strip()
            attitude, told = asyncio.run(visit(port, file.as_uri()))
        finally:
            firefox.terminate()
    run = run_dataset()
    saved = run["quaternion"].values[int(np.flatnonzero(run["time"] == 5.0)[0])]
    np.testing.assert_allclose(attitude, saved, atol=1e-6)
    assert told == []

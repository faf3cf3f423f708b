"""The real server, driven by the official client over stdio; and what the command says where it cannot serve."""

import asyncio
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from imdim.app import cli
from imdim.reconstruction import config

ROOT = Path(__file__).parents[3]


def test_without_the_extra_it_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setattr(config, "find_spec", lambda name: None)
    assert cli.main(["mcp"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "imdim mcp needs mcp: " in said
    assert "[agent]" in said


def test_a_folder_that_is_none_is_one_line(tmp_path, capsys):
    pytest.importorskip("mcp")
    assert cli.main(["mcp", str(tmp_path / "gone")]) == 2
    assert capsys.readouterr().err == f"imdim: {tmp_path / 'gone'}: is no folder\n"


def talk(folder, conversation):
    """Run `conversation(client)` with a server of its own."""
    mcp = pytest.importorskip("mcp")
    from mcp.client.stdio import stdio_client

    server = mcp.StdioServerParameters(command=sys.executable, args=["-m", "imdim.app.cli", "mcp", str(folder)], env=dict(os.environ))

    async def run():
        async with stdio_client(server, sys.__stderr__) as streams, mcp.ClientSession(*streams) as client:
            await client.initialize()
            await conversation(client)

    asyncio.run(asyncio.wait_for(run(), 240))


def test_the_tools_over_stdio(folder):
    told = []

    async def hear(seconds, total, message):
        told.append((seconds, message))

    async def conversation(client):
        tools = {tool.name: tool for tool in (await client.list_tools()).tools}
        assert {
            "open",
            "fit",
            "features",
            "explain",
            "set",
            "tie",
            "untie",
            "lock",
            "add",
            "remove",
            "refit",
            "undo",
            "export",
        } <= tools.keys()
        assert all(tool.description and tool.outputSchema for tool in tools.values())
        assert tools["measure"].annotations.readOnlyHint
        for name, arguments, says in (
            ("open", {"path": "/etc/passwd"}, "relative to the folder"),
            ("open", {"path": "../part.stl"}, "leads out"),
            ("open", {}, "path: Field required"),
            ("open", {"path": "part.stl", "more": 1}, "more: "),
            ("add", {"does": "weld", "feature": {}}, "does: "),
            ("nothing", {}, "no tool nothing"),
            ("measure", {}, "there is no program"),
            ("undo", {}, "nothing to undo"),
        ):
            answer = await client.call_tool(name, arguments)
            assert answer.isError
            assert says in answer.content[0].text
            assert "\n" not in answer.content[0].text
            assert str(folder) not in answer.content[0].text
        await client.call_tool("open", {"path": "part.stl"})
        opened = await client.call_tool("open", {"path": "plate"})
        assert opened.structuredContent == json.loads(opened.content[0].text)
        changed = (await client.call_tool("set", {"values": {"hole_diameter": 8}})).structuredContent
        assert changed["iou"] < changed["iou_before"]
        assert (await client.call_tool("undo", {})).structuredContent["step"] == "set hole_diameter = 8"
        exported = (await client.call_tool("export", {"folder": "out"})).structuredContent
        assert exported["files"]["program.scad"] == "written"
        fitting = asyncio.create_task(client.call_tool("fit", {"budget_s": 600}, progress_callback=hear))
        while not told:
            await asyncio.sleep(0.05)
        busy = await client.call_tool("measure", {})
        assert busy.isError
        assert "stop_fit" in busy.content[0].text
        assert (await client.call_tool("stop_fit", {"keep": False})).structuredContent == {"stopped": True}
        assert (await fitting).isError
        assert (await client.call_tool("status", {})).structuredContent["program"] == "plate"

    talk(folder, conversation)
    assert (folder / "out/mesh.stl").is_file()
    assert told[0][1] == "starting"


def test_what_is_no_message_is_a_line_on_the_terminal_and_the_others_are_answered(folder):
    pytest.importorskip("mcp")
    about = {"protocolVersion": "2024-11-05", "capabilities": {}, "clientInfo": {"name": "test", "version": "1"}}
    lines = [
        b"garbage",
        b'{"jsonrpc":"2.0"',
        b"[1, 2]",
        b"\xff\xfe",
        json.dumps({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": about}).encode(),
        b'{"jsonrpc":"2.0","method":"notifications/initialized"}',
        b'{"jsonrpc":"2.0","id":2,"method":"nonsense"}',
        b"x" * 100_000,
        b'{"jsonrpc":"2.0","id":3,"method":"tools/call","params":{"name":"measure"}}',
    ]
    command = [sys.executable, "-m", "imdim.app.cli", "mcp", str(folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as server:
        assert server.stdin is not None
        assert server.stdout is not None
        server.stdin.write(b"\n".join([*lines, b""]))
        server.stdin.flush()
        answers = {answer["id"]: answer for answer in (json.loads(server.stdout.readline()) for _ in range(3))}
        _, told = server.communicate(timeout=60)
    assert server.returncode == 0
    assert answers.keys() == {1, 2, 3}
    assert "error" in answers[2]
    assert "there is no program" in answers[3]["result"]["content"][0]["text"]
    said = told.decode().splitlines()
    assert len(said) == 6
    assert said[0] == "imdim mcp: not a message of the protocol: 'garbage'"
    assert all(line.startswith("imdim mcp: ") and len(line) < 200 for line in said)


def test_a_fit_that_the_client_cancels_keeps_nothing(folder):
    mcp = pytest.importorskip("mcp")
    told = []

    async def hear(seconds, total, message):
        told.append(message)

    async def conversation(client):
        for path in ("part.stl", "plate"):
            await client.call_tool("open", {"path": path})
        number = client._request_id  # the official client tells it nowhere else
        fitting = asyncio.create_task(client.call_tool("fit", {"budget_s": 600}, progress_callback=hear))
        while not told:
            await asyncio.sleep(0.05)
        cancelled = mcp.types.CancelledNotification(
            method="notifications/cancelled", params=mcp.types.CancelledNotificationParams(requestId=number)
        )
        await client.send_notification(mcp.types.ClientNotification(cancelled))
        with pytest.raises(mcp.McpError, match="cancelled"):
            await fitting
        while (status := await client.call_tool("status", {})).isError:
            assert "another call is going on" in status.content[0].text
            await asyncio.sleep(0.05)
        assert status.structuredContent["undo"][0] == "open plate"

    talk(folder, conversation)


def test_the_conversation_of_the_page_goes_as_it_says(folder):
    page = (ROOT / "docs/agents.md").read_text(encoding="utf-8")
    calls = re.findall(r"^> (\w+) (\{.*\})\n((?:[^>`\n].*\n)*)", page.split("## A conversation")[1], re.MULTILINE)
    assert len(calls) >= 6

    async def conversation(client):
        for name, arguments, answer in calls:
            given = await client.call_tool(name, json.loads(arguments))
            text = given.content[0].text
            # the page shows some of each answer
            for piece in (piece.strip() for piece in answer.split("...")):
                assert piece in text, (name, piece, text)

    talk(folder, conversation)


def test_the_page_has_every_tool():
    pytest.importorskip("mcp")
    from imdim.app.agent.server import TOOLS

    page = (ROOT / "docs/agents.md").read_text(encoding="utf-8")
    assert [name for name in TOOLS if f"`{name}`" not in page] == []
    for block in re.findall(r"^```json\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        servers = json.loads(block).get("mcpServers") or json.loads(block)["servers"]
        assert servers["imdim"]["args"][0] == "mcp"


def test_the_client_repairs_a_mistake(monkeypatch):
    pytest.importorskip("mcp")
    monkeypatch.syspath_prepend(str(ROOT / "scripts/agent"))
    import repair

    assert asyncio.run(repair.run(["a wrong unit"])) == 1

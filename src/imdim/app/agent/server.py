"""`imdim mcp`: the tools of a session over the Model Context Protocol, on stdin and stdout. No error is more than a line."""

from __future__ import annotations

import argparse
import inspect
import json
import logging
import os
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TextIO, get_type_hints

import anyio
from anyio.abc import ObjectReceiveStream, ObjectSendStream
from mcp import types
from mcp.server.lowlevel import Server
from mcp.server.stdio import stdio_server
from mcp.shared.message import SessionMessage
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError, create_model

import imdim
from imdim.app.agent.session import REFUSED, AgentSession
from imdim.app.agent.workplace import Workplace
from imdim.reconstruction.config import first_line, one_line

ABOUT = (
    "IMDIM turns meshes and point clouds into short CAD programs. Open a part, fit it or open its program, list features and parameters, "
    "correct them, measure after each step, undo what does not help, export. Lengths are in the part's units, angles in degrees."
)
READS = ("status", "features", "explain", "parameters", "measure")
TOOLS = (
    *("status", "open", "fit", "stop_fit", "features", "explain", "measure", "parameters", "set", "tie", "untie", "hold", "drop", "lock"),
    *("scale", "add", "remove", "refit", "relate", "undo", "redo", "export"),
)
MESSAGE, SHOWN = 400, 80  # characters of an error, and of what is no message


@dataclass(frozen=True)
class AgentTool:
    """A method of the session with what it takes and gives."""

    name: str
    about: str
    takes: type[BaseModel]
    gives: TypeAdapter[Any]

    @staticmethod
    def of(name: str) -> AgentTool:
        """The tool that the method of that name is."""
        method = getattr(AgentSession, name)
        hints = get_type_hints(method, include_extras=True)
        given = {n: p for n, p in inspect.signature(method).parameters.items() if n not in ("self", "progress")}
        fields: dict[str, Any] = {n: (hints[n], ... if p.default is inspect.Parameter.empty else p.default) for n, p in given.items()}
        takes = create_model(name, __config__=ConfigDict(extra="forbid"), **fields)
        return AgentTool(name, " ".join((inspect.getdoc(method) or "").split()), takes, TypeAdapter(hints["return"]))

    def describe(self) -> types.Tool:
        """As clients list it."""
        hints = types.ToolAnnotations(readOnlyHint=self.name in READS, destructiveHint=self.name == "export", openWorldHint=False)
        gives = self.gives.json_schema(mode="serialization")
        return types.Tool(
            name=self.name, description=self.about, inputSchema=self.takes.model_json_schema(), outputSchema=gives, annotations=hints
        )


class AgentServer:
    """The tools of one session. One call works at a time; while a fit goes on, `stop_fit` is what else can be called."""

    def __init__(self, session: AgentSession) -> None:
        self._session, self._busy = session, threading.Lock()
        self._tools: Mapping[str, AgentTool] = {name: AgentTool.of(name) for name in TOOLS}
        self.server: Server[Any, Any] = Server("imdim", imdim.__version__, ABOUT)
        self.server.list_tools()(self._list)
        self.server.call_tool(validate_input=False)(self._call)

    async def serve(self, incoming_text: TextIO, outgoing_text: TextIO) -> None:
        """Answer until the client closes what comes in."""
        passed, messages = anyio.create_memory_object_stream[SessionMessage | Exception]()
        streams = stdio_server(anyio.wrap_file(incoming_text), anyio.wrap_file(outgoing_text))
        async with streams as (incoming, outgoing), anyio.create_task_group() as tasks:
            tasks.start_soon(_pass_on_messages, incoming, passed)
            await self.server.run(messages, outgoing, self.server.create_initialization_options())

    async def _list(self) -> list[types.Tool]:
        return [tool.describe() for tool in self._tools.values()]

    async def _call(self, name: str, arguments: dict[str, Any]) -> types.CallToolResult:
        tool = self._tools.get(name)
        if tool is None:
            return _refusal(f"no tool {one_line(name)}; there are {', '.join(TOOLS)}")
        try:
            given = tool.takes.model_validate(arguments)
        except ValidationError as error:
            wrong = error.errors(include_url=False, include_context=False)[0]
            return _refusal(f"{name}: {'.'.join(map(str, wrong['loc'])) or 'arguments'}: {wrong['msg']}")
        values = {field: getattr(given, field) for field in tool.takes.model_fields}
        if name == "fit":
            values["progress"] = self._progress()
        work = partial(self._work, tool, values)
        try:
            return await anyio.to_thread.run_sync(work, abandon_on_cancel=True)
        except anyio.get_cancelled_exc_class():
            if name == "fit":
                self._session.stop_fit(keep=False)
            raise

    def _work(self, tool: AgentTool, values: dict[str, Any]) -> types.CallToolResult:
        """Call a method, in a thread of its own."""
        alone = tool.name != "stop_fit"
        if alone and not self._busy.acquire(blocking=False):
            return _refusal(f"{tool.name}: another call is going on; stop_fit ends a fit")
        try:
            reply = tool.gives.dump_python(getattr(self._session, tool.name)(**values), mode="json")
            return types.CallToolResult(content=[types.TextContent(type="text", text=json.dumps(reply))], structuredContent=reply)
        except REFUSED as error:
            return _refusal(f"{tool.name}: {self._session.workplace.shorten(first_line(error))}")
        except Exception as error:  # noqa: BLE001 - the outermost call: whatever broke is told to the client, and to the terminal
            sys.stderr.write(f"imdim mcp: {traceback.format_exc()}" if os.environ.get("IMDIM_TRACEBACK") else "")
            return _refusal(f"{tool.name}: internal error, {type(error).__name__}: {self._session.workplace.shorten(first_line(error))}")
        finally:
            if alone:
                self._busy.release()

    def _progress(self) -> Callable[[float, float, str], None]:
        """What tells the client of a fit, from its thread, where the client asked for that."""
        context = self.server.request_context
        token = context.meta.progressToken if context.meta else None

        def tell(seconds: float, total: float, message: str) -> None:
            if token is not None:
                anyio.from_thread.run(context.session.send_progress_notification, token, seconds, total, message)

        return tell


async def _pass_on_messages(
    incoming: ObjectReceiveStream[SessionMessage | Exception], passed: ObjectSendStream[SessionMessage | Exception]
) -> None:
    """What is no message is told on the terminal in a line; to the library it is an error of its own, which it logs and sends in pages."""
    async with passed:
        async for message in incoming:
            if isinstance(message, Exception):
                sys.stderr.write(f"imdim mcp: not a message of the protocol: {_line_of(message)}\n")
            else:
                await passed.send(message)


def _line_of(error: Exception) -> str:
    given = error.errors()[0]["input"] if isinstance(error, ValidationError) else error
    return one_line(ascii(given.strip() if isinstance(given, str) else given), SHOWN)


class _FirstLines(logging.Formatter):
    """What the library logs of a request that cannot be, of pages and with traces, as a line."""

    def format(self, record: logging.LogRecord) -> str:
        return f"imdim mcp: {one_line(record.getMessage().partition(chr(10))[0], MESSAGE)}"


def _refusal(message: str) -> types.CallToolResult:
    return types.CallToolResult(content=[types.TextContent(type="text", text=one_line(message, MESSAGE))], isError=True)


def main(argv: Sequence[str]) -> int:
    """Serve one client; raises ConfigError for a folder that is none."""
    parser = argparse.ArgumentParser(prog="imdim mcp", description="Serve language-model agents over MCP on stdin and stdout.")
    parser.add_argument("folder", nargs="?", default=".", help="what may be read and written (default: the current folder)")
    session = AgentSession(Workplace(Path(parser.parse_args(argv).folder)))
    told = logging.StreamHandler()
    told.setFormatter(_FirstLines())
    logging.basicConfig(handlers=[told])
    with _own_streams() as (incoming, outgoing), closing(session):
        anyio.run(AgentServer(session).serve, incoming, outgoing)
    return 0


@contextmanager
def _own_streams() -> Iterator[tuple[TextIO, TextIO]]:
    """stdin and stdout for the protocol alone: what libraries print goes to stderr, and processes that are started read nothing."""
    sys.stdout.flush()
    kept = os.dup(0), os.dup(1)
    try:
        with open(os.devnull, "rb") as nothing:
            os.dup2(nothing.fileno(), 0)
        os.dup2(2, 1)
        with (
            os.fdopen(kept[0], encoding="utf-8", errors="replace", closefd=False) as incoming,
            os.fdopen(kept[1], "w", encoding="utf-8", closefd=False) as outgoing,
        ):
            yield incoming, outgoing
    finally:
        for number, stream in enumerate(kept):
            os.dup2(stream, number)
            os.close(stream)

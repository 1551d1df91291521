"""No gateway forgets a command: what stands in the source with `@command` is in each of them."""

import ast
import inspect
import re
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from contract import test_gateway_epics as epics
from contract import test_gateway_http as http
from contract.cabinet import WithBell
from cosmic.app.gateways.approvals import Approvals
from cosmic.app.gateways.campaigns import Campaigns
from cosmic.app.gateways.openapi import described, mcp_tools
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.declaration import Declared
from cosmic.frame.network.host import Host
from cosmic.mico.api.mico import Mico
from cosmic.vico.api.vico import Vico

KINDS = {"mico": Mico, "daqco": Daqco, "vico": Vico, "campaigns": Campaigns, "approvals": Approvals}
LEAST = {"mico": 30, "daqco": 20, "vico": 20, "campaigns": 6, "approvals": 2}


def marked(kind: type, mark: str) -> Iterator[tuple[str, str]]:
    """Yield names and results of the functions that stand below a mark, as the source has them."""
    seen = set()
    for each in kind.__mro__:
        if not each.__module__.startswith(("cosmic.", "contract.")):
            continue
        (body,) = ast.parse(inspect.cleandoc("\n" + inspect.getsource(each))).body
        assert isinstance(body, ast.ClassDef)
        for found in body.body:
            if not isinstance(found, ast.FunctionDef) or found.name in seen:
                continue
            for decorator in found.decorator_list:
                called = decorator.func if isinstance(decorator, ast.Call) else decorator
                if isinstance(called, ast.Name) and called.id == mark:
                    seen.add(found.name)
                    yield found.name, ast.unparse(found.returns) if found.returns else ""


def commands(kind: type, before: str = "") -> Iterator[str]:
    """Yield the commands of a class and its parts; a part with keys has `*` behind its name."""
    for name, _ in marked(kind, "command"):
        yield before + name
    for name, result in marked(kind, "part"):
        word = next(
            each for each in re.findall(r"\w+", result)[::-1] if each not in {"None", "str"}
        )
        owner = next(each for each in kind.__mro__ if name in vars(each))
        inner: Any = vars(sys.modules[owner.__module__]).get(word)
        if inner is None:  # imported for types only
            inner = next(each for each in subclasses(Declared) if each.__name__ == word)
        yield from commands(inner, f"{before}{name}.{'*.' if 'Mapping' in result else ''}")


def subclasses(kind: type) -> Iterator[type]:
    for each in kind.__subclasses__():
        yield each
        yield from subclasses(each)


def all_commands(kinds: dict[str, Any]) -> set[str]:
    return {f"{name}.{each}" for name, kind in kinds.items() for each in commands(kind)}


@pytest.mark.parametrize("name", KINDS)
def test_every_command_of_an_application_is_in_openapi_and_mcp(name: str) -> None:
    kinds = {name: KINDS[name]}
    wanted = all_commands(kinds)
    assert len(wanted) >= LEAST[name]
    paths = {
        re.sub(r"\{\w+_key\}", "*", path.removeprefix("/api/")).replace("/", ".")
        for path, methods in described(kinds)["paths"].items()
        if "post" in methods and path != "/api/control"
    }
    assert paths == wanted
    tools = {each["name"] for each in mcp_tools(kinds)}
    assert tools == {each.replace(".*", "").replace(".", "_") for each in wanted}


def test_every_command_answers_over_http_mcp_and_epics_and_at_the_station() -> None:
    wanted = all_commands({"cabinet": WithBell})
    assert {"cabinet.ring", "cabinet.lamp.shine", "cabinet.drawers.*.move"} <= wanted
    home = WithBell()
    host = Host("cabinet", home)
    offered = {name for name in host.offered if name[0] not in "@#"}
    host.close()
    assert offered >= {each.replace(".*", "").removeprefix("cabinet.") for each in wanted}
    wrong = {"no such argument": 1}
    stop = "cabinet.stop"  # is carried out whatever it is given, and answers so
    wanted.remove(stop)
    with http.opened(WithBell) as door, door.client() as client:
        client.post("/api/control")
        said = {"jsonrpc": "2.0", "id": 1, "method": "tools/list"}
        listed = client.post("/mcp", json=said).json()["result"]["tools"]
        assert {each.replace(".*", "").replace(".", "_") for each in {stop, *wanted}} <= {
            each["name"] for each in listed
        }
        assert client.post("/api/cabinet/stop", json=wrong).json() == {"result": None}
        said = {"jsonrpc": "2.0", "id": 1, "method": "tools/call"}
        call = {"params": {"name": "cabinet_stop", "arguments": wrong}}
        assert not client.post("/mcp", json=said | call).json()["result"]["isError"]
        assert door.home.stops == 2
        for each in wanted:
            path = "/api/" + each.replace("*", "top").replace(".", "/")
            answer = client.post(path, json=wrong)
            assert answer.status_code == 400, path
            assert "takes" in answer.json()["error"]["text"], path
            tool = {"name": each.replace(".*", "").replace(".", "_")}
            keys = {"drawers_key": "top"} if "*" in each else {}
            said = {"jsonrpc": "2.0", "id": 1, "method": "tools/call"}
            call = client.post("/mcp", json=said | {"params": tool | {"arguments": wrong | keys}})
            assert "takes" in call.json()["error"]["message"], each
    with epics.opened(WithBell) as there, epics.used(there) as line:
        assert line.put("T:control", 1)
        assert line.put("T:cabinet:stop", '{"no such argument": 1}')
        assert there.home.stops == 1
        for each in wanted - {"cabinet.spare.shine"}:  # there is no spare lamp now
            record = "T:" + each.replace("*", "top").replace(".", ":")
            assert not line.put(record, '{"no such argument": 1}'), record
            assert "takes" in line.get(record), record

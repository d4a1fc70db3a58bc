"""Webots' scene language (VRML 97 with PROTO) as a tree of nodes, with writer and reader.

A field's value is a tuple of numbers (`0 0 1`), a number list in brackets (a list of floats), a string, a truth value,
a node, a list of nodes or strings, `None` (NULL) or an `Is` (a field that a PROTO takes from its interface).
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from pipeline.errors import PipelineError
from pipeline.robot.model_files import numbers

TOKEN = re.compile(r"""\s+|,|\#[^\n]*|(?P<text>"(?:\\.|[^"\\])*")|(?P<mark>[{}\[\]])|(?P<word>[^\s{}\[\]",\#]+)""")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z")


class VrmlError(PipelineError):
    """A text that is not a scene; `line` is counted from 1."""

    def __init__(self, problem: str, line: int):
        self.line = line
        super().__init__(f"line {line}: {problem}")


@dataclass(frozen=True)
class Is:
    """A value taken from the PROTO's interface."""

    field: str


@dataclass(frozen=True, kw_only=True)
class Node:
    """A node of the scene."""

    kind: str
    fields: dict[str, Any] = field(default_factory=dict)
    name: str = ""
    """Name of its DEF, else empty."""

    def nodes(self) -> "Iterator[Node]":
        """This node and all below it."""
        yield self
        for value in self.fields.values():
            for each in value if isinstance(value, list) else [value]:
                if isinstance(each, Node):
                    yield from each.nodes()

    def all(self, kind: str) -> "list[Node]":
        return [each for each in self.nodes() if each.kind == kind]


def node(kind: str, /, **fields: Any) -> Node:
    """A node without a name."""
    return Node(kind=kind, fields=fields)


@dataclass(frozen=True, kw_only=True)
class Proto:
    """A node type: its interface as (type, name, default), and the node it expands to."""

    name: str
    interface: tuple[tuple[str, str, Any], ...]
    body: Node


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A `.wbt` or `.proto` file."""

    version: str
    """Release, such as `R2023b`."""
    extern: tuple[str, ...]
    """Files of the PROTOs that it uses."""
    protos: tuple[Proto, ...]
    nodes: tuple[Node, ...]


def to_text(scene: Scene) -> str:
    """The file."""
    lines = [f"#VRML_SIM {scene.version} utf8", ""]
    lines += [f'EXTERNPROTO "{path}"' for path in scene.extern]
    for proto in scene.protos:
        lines.append(f"PROTO {proto.name} [")
        lines += [f"  field {kind} {name} {_value(value, 1)}" for kind, name, value in proto.interface]
        lines += ["]", "{", "  " + _node(proto.body, 1), "}"]
    lines += [_node(node, 0) for node in scene.nodes]
    return "\n".join(lines) + "\n"


def _node(node: Node, depth: int) -> str:
    inside = "  " * (depth + 1)
    head = f"DEF {node.name} {node.kind} {{" if node.name else f"{node.kind} {{"
    fields = [f"{inside}{name} {_value(value, depth + 1)}" for name, value in node.fields.items()]
    return "\n".join([head, *fields, "  " * depth + "}"])


def _value(value: Any, depth: int) -> str:
    if value is None:
        return "NULL"
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, Is):
        return f"IS {value.field}"
    if isinstance(value, Node):
        return _node(value, depth)
    if isinstance(value, tuple):
        return numbers(value)
    if all(isinstance(each, float) for each in value):
        return f"[ {numbers(value)} ]" if value else "[ ]"
    inside = "  " * (depth + 1)
    return "\n".join(["[", *(f"{inside}{_value(each, depth + 1)}" for each in value), "  " * depth + "]"])


def from_text(text: str) -> Scene:
    """The scene of a file. Raises VrmlError."""
    head = re.match(r"#VRML_SIM (\S+) utf8", text)
    if head is None:
        raise VrmlError("the header '#VRML_SIM <version> utf8' is missing.", 1)
    return _Reader(text).scene(head.group(1))


class _Reader:
    def __init__(self, text: str):
        self.tokens: list[tuple[str, int]] = []
        at = 0
        while at < len(text):
            found = TOKEN.match(text, at)
            if found is None:
                raise VrmlError(f"cannot be read from {text[at : at + 20]!r} on.", text.count("\n", 0, at) + 1)
            if found.lastgroup:
                self.tokens.append((found.group(), text.count("\n", 0, at) + 1))
            at = found.end()
        self.at = 0

    def scene(self, version: str) -> Scene:
        extern, protos, nodes = [], [], []
        while self.at < len(self.tokens):
            if self._peek() in ("EXTERNPROTO", "PROTO"):
                if self._next() == "EXTERNPROTO":
                    extern.append(_unquoted(self._next()))
                else:
                    protos.append(self._proto())
            else:
                nodes.append(self._node())
        return Scene(version=version, extern=tuple(extern), protos=tuple(protos), nodes=tuple(nodes))

    def _proto(self) -> Proto:
        name, interface = self._next(), []
        self._expect("[")
        while self._peek() != "]":
            self._expect("field")
            interface.append((self._next(), self._next(), self._value()))
        self._expect("]")
        self._expect("{")
        body = self._node()
        self._expect("}")
        return Proto(name=name, interface=tuple(interface), body=body)

    def _node(self) -> Node:
        kind, name = self._next(), ""
        if kind == "DEF":
            name, kind = self._next(), self._next()
        if not kind[0].isupper():
            raise VrmlError(f"'{kind}' is not a node.", self._line())
        self._expect("{")
        fields: dict[str, Any] = {}
        while self._peek() != "}":
            key = self._next()
            if not key[0].isalpha() or key in fields:
                raise VrmlError(f"'{key}' is not a field, or occurs twice in a {kind}.", self._line())
            fields[key] = self._value()
        self._expect("}")
        return Node(kind=kind, fields=fields, name=name)

    def _value(self) -> Any:
        token = self._peek()
        if token == "[":
            return self._list()
        if token in ("TRUE", "FALSE", "NULL"):
            return {"TRUE": True, "FALSE": False, "NULL": None}[self._next()]
        if token == "IS":
            self._next()
            return Is(self._next())
        if token.startswith('"'):
            return _unquoted(self._next())
        if NUMBER.match(token):
            return tuple(self._numbers())
        return self._node()

    def _list(self) -> list[Any]:
        self._expect("[")
        values: list[Any] = []
        while self._peek() != "]":
            if NUMBER.match(self._peek()):
                values += self._numbers()
            else:
                values.append(self._value())
        self._expect("]")
        return values

    def _numbers(self) -> Iterator[float]:
        while self.at < len(self.tokens) and NUMBER.match(self._peek()):
            yield float(self._next())

    def _peek(self) -> str:
        if self.at >= len(self.tokens):
            raise VrmlError("the file ends inside a node.", self._line())
        return self.tokens[self.at][0]

    def _next(self) -> str:
        token = self._peek()
        self.at += 1
        return token

    def _expect(self, token: str) -> None:
        got = self._next()
        if got != token:
            raise VrmlError(f"expected '{token}', got '{got}'.", self._line())

    def _line(self) -> int:
        """Line of the last token."""
        return self.tokens[min(self.at, len(self.tokens)) - 1][1] if self.tokens else 1


def _unquoted(token: str) -> str:
    return re.sub(r"\\(.)", r"\1", token[1:-1])

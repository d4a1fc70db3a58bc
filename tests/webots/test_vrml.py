"""Webots' scene language: what is written is read back, and a broken file is refused with its line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.webots.vrml import Is, Node, Proto, Scene, VrmlError, from_text, to_text

HEAD = "#VRML_SIM R2023b utf8\n"

numbers = st.floats(allow_nan=False, allow_infinity=False, width=32).map(lambda value: value + 0.0)
leaves = st.one_of(
    st.lists(numbers, min_size=1, max_size=4).map(tuple),
    st.lists(numbers, max_size=4),
    st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=12),
    st.booleans(),
    st.none(),
)
names = st.from_regex(r"[a-z][A-Za-z]{0,6}", fullmatch=True)
kinds = st.sampled_from(["Solid", "HingeJoint", "Physics"])


@st.composite
def scene_nodes(draw: st.DrawFn, depth: int = 2) -> Node:
    inner = [leaves] if depth == 0 else [leaves, scene_nodes(depth - 1), st.lists(scene_nodes(depth - 1), max_size=2)]
    return Node(kind=draw(kinds), fields=draw(st.dictionaries(names, st.one_of(*inner), max_size=3)))


@given(scene_nodes())
def test_every_scene_is_read_back_as_written(node: Node):
    scene = Scene(version="R2023b", extern=("../protos/A.proto",), protos=(), nodes=(node,))
    assert from_text(to_text(scene)) == scene


def test_a_proto_is_read_back_with_its_interface():
    body = Node(kind="Robot", fields={"name": Is("name"), "children": []})
    proto = Proto(
        name="A", interface=(("SFString", "name", 'a "b" \\'), ("SFVec3f", "at", (0.0, 1e-05, -2.0))), body=body
    )
    scene = Scene(version="R2023b", extern=(), protos=(proto,), nodes=())
    assert from_text(to_text(scene)) == scene


def test_comments_commas_and_free_layout_are_read():
    text = HEAD + '# a remark\nDEF R Robot{translation 0,0,1.5e0 children[Solid{name"a # b"}Solid{}]supervisor TRUE}'
    (node,) = from_text(text).nodes
    assert node.name == "R"
    assert node.fields["translation"] == (0.0, 0.0, 1.5)
    assert [child.fields for child in node.fields["children"]] == [{"name": "a # b"}, {}]
    assert node.fields["supervisor"] is True


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("Robot { }", 1, "header"),
        (HEAD + 'Robot {\n name "a"', 3, "ends inside"),
        (HEAD + 'Robot {\n name "a"\n name "b"\n}', 4, "twice"),
        (HEAD + "Robot {\n children [ 1 }\n}", 3, "is not a node"),
        (HEAD + 'Robot {\n name "never closed\n}', 3, "cannot be read"),
        (HEAD + "robot { }", 2, "is not a node"),
        (HEAD + "Robot ]", 2, "expected"),
    ],
)
def test_a_broken_file_is_refused_with_its_line(text: str, line: int, problem: str):
    with pytest.raises(VrmlError, match=problem) as caught:
        from_text(text)
    assert caught.value.line == line

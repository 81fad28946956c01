# SPDX-License-Identifier: GPL-3.0-or-later
"""Following links of a shader node tree through reroutes, groups and muted nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

# A file can hold links that Blender shows as invalid; a walk longer than this is one that never ends.
MAX_STEPS = 1000


@dataclass(frozen=True)
class Endpoint:
    """Where the value of a socket comes from.

    socket: an output of a node that computes something, or an unlinked input whose default value holds. groups: the
    group nodes that enclose it, outermost first.
    """

    socket: Any
    groups: tuple[Any, ...] = ()

    @property
    def node(self) -> Any:
        """The node that the socket belongs to."""
        return self.socket.node

    @property
    def is_constant(self) -> bool:
        """Whether the value is the default of an unlinked input."""
        return not self.socket.is_output

    def input(self, name: str) -> Endpoint:
        """The source of the node's enabled input of that name; KeyError where there is none."""
        return source(named_socket(self.node.inputs, name), self.groups)


def named_socket(sockets: Any, name: str) -> Any:
    """The enabled socket of that name (Mix nodes hold one per data type). Raises KeyError where there is none."""
    for socket in sockets:
        if socket.name == name and socket.enabled:
            return socket
    raise KeyError(name)


def source(socket: Any, groups: tuple[Any, ...] = ()) -> Endpoint:
    """Where the value of an input socket comes from."""
    for _ in range(MAX_STEPS):
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None:
            return Endpoint(socket, groups)
        step = _through(link.from_socket, groups)
        if step is None:
            return Endpoint(link.from_socket, groups)
        socket, groups = step
    return Endpoint(socket, groups)


def _through(output: Any, groups: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]] | None:
    """The input socket that a pass-through node forwards to `output`; None where the node computes something."""
    node = output.node
    if node.mute:
        internal = next((link.from_socket for link in node.internal_links if link.to_socket == output), None)
        return None if internal is None else (internal, groups)
    if node.type == "REROUTE":
        return node.inputs[0], groups
    if node.type == "GROUP" and node.node_tree is not None:
        inner = next((n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT" and n.is_active_output), None)
        found = None if inner is None else _by_identifier(inner.inputs, output.identifier)
        return None if found is None else (found, (*groups, node))
    if node.type == "GROUP_INPUT" and groups:
        found = _by_identifier(groups[-1].inputs, output.identifier)
        return None if found is None else (found, groups[:-1])
    return None


def _by_identifier(sockets: Any, identifier: str) -> Any:
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def node_tree_of(owner: Any) -> Any | None:
    """The node tree that a material or world shows, None where it shows its plain colour (before 5.0)."""
    if bpy.app.version < (5, 0) and not owner.use_nodes:
        return None
    return owner.node_tree


def node_label(owner: str, node: Any) -> str:
    """How findings name a node: its owner, then the node as the artist sees it."""
    return f"{owner}, node {node.name!r}"

"""Names of ROS 2 topics, services, nodes and types, and how rmw_zenoh puts them into key expressions."""

from __future__ import annotations

import re

from reconros_zenoh.errors import UsageError

_UNALLOWED = re.compile(r"[^A-Za-z0-9_/]")
_LONGEST_TOPIC = 247  # RMW_TOPIC_MAX_NAME_LENGTH
_LONGEST_NAMESPACE = 245  # RMW_NAMESPACE_MAX_LENGTH
_LONGEST_NODE = 255  # RMW_NODE_NAME_MAX_NAME_LENGTH


def data_key(domain: int, topic: str, dds_type: str, type_hash: str) -> str:
    """Return the key expression of a topic or service, `<domain>/<topic>/<type>/<hash>`.

    `topic` is a resolved name; its leading slash does not appear in the key.
    """
    return f"{domain}/{topic.strip('/')}/{dds_type}/{type_hash}"


def dds_type_name(name: str) -> str:
    """Return the name of a type on the wire: `sensor_msgs::msg::dds_::Image_` for `sensor_msgs/msg/Image`."""
    package, kind, type_name = name.split("/")
    return f"{package}::{kind}::dds_::{type_name}_"


def type_name_of(dds_name: str) -> str:
    """Return the name of the type whose name on the wire is this: the reverse of `dds_type_name`."""
    return dds_name.removesuffix("_").replace("::dds_::", "/").replace("::", "/")


def mangle(name: str) -> str:
    """Return `name` as one part of a key: every `/` is a `%`, and the empty name stands for the root."""
    return name.replace("/", "%") or "%"


def demangle(part: str) -> str:
    """Return the name that `mangle` made `part` from."""
    return part.replace("%", "/")


def resolve(name: str, node_namespace: str, node_name: str) -> str:
    """Return the absolute name of a topic or service that a node calls `name`.

    `/a` stays as it is, `a` is in the namespace of the node, `~/a` and `~` are in the node itself. Raises
    UsageError when one of the three names is not allowed.
    """
    check_topic_name(name)
    check_namespace(node_namespace)
    check_node_name(node_name)
    namespace = node_namespace.rstrip("/")
    if name.startswith("~"):
        name = f"{namespace}/{node_name}{name[1:]}"
    elif not name.startswith("/"):
        name = f"{namespace}/{name}"
    _require(len(name) <= _LONGEST_TOPIC, "topic or service", name, f"is longer than {_LONGEST_TOPIC}")
    return name


def check_topic_name(name: str) -> None:
    """Raise UsageError, with the reason, unless `name` may be given to a topic or service.

    The rules are those of `rcl_validate_topic_name` and `rmw_validate_full_topic_name`; substitutions in
    curly braces are not supported, nor `~a`, of which rcl makes `/nodea`.
    """
    what = "topic or service"
    _require(name != "", what, name, "is empty")
    if name.startswith("~"):
        _require(name == "~" or name[1] == "/", what, name, "has a '~' that is not followed by '/'")
        name = name[1:]
    _check_tokens(what, name)
    _require(len(name) <= _LONGEST_TOPIC, what, name, f"is longer than {_LONGEST_TOPIC}")


def check_namespace(name: str) -> None:
    """Raise UsageError, with the reason, unless `name` is a namespace: `/` or an absolute name.

    The rules are those of `rmw_validate_namespace`.
    """
    _require(name.startswith("/"), "namespace", name, "does not begin with '/'")
    if name != "/":
        _check_tokens("namespace", name)
    _require(len(name) <= _LONGEST_NAMESPACE, "namespace", name, f"is longer than {_LONGEST_NAMESPACE}")


def check_node_name(name: str) -> None:
    """Raise UsageError, with the reason, unless a node may be called `name`.

    The rules are those of `rmw_validate_node_name`.
    """
    _require(name != "", "node", name, "is empty")
    _require("/" not in name, "node", name, "contains '/'; the namespace is given separately")
    _check_tokens("node", name)
    _require(len(name) <= _LONGEST_NODE, "node", name, f"is longer than {_LONGEST_NODE}")


def _check_tokens(what: str, name: str) -> None:
    unallowed = _UNALLOWED.search(name)
    if unallowed is not None:
        _require(
            False, what, name, f"contains {unallowed[0]!r}; letters a-z, digits, '_' and '/' are allowed"
        )
    _require(not name.endswith("/"), what, name, "ends with '/'")
    _require("//" not in name, what, name, "contains '//'")
    for token in name.split("/"):
        _require(not token[:1].isdigit(), what, name, f"has a part that begins with a digit, {token!r}")


def _require(allowed: bool, what: str, name: str, reason: str) -> None:
    if not allowed:
        raise UsageError(f"The {what} name {name!r} {reason}. Choose a name that ROS 2 allows.")

"""Interface names as a project file writes them, turned into names of ROS 2."""

from __future__ import annotations


def ros_type_name(package: str, kind: str, name: str) -> str:
    """Return the ROS 2 name of an interface: `std_msgs`, `msg`, `U_Int32` make `std_msgs/msg/UInt32`.

    Older project files split the words of a type name with underscores, which no name of ROS 2 has. Listing 1
    of ReconROS Executor, Section IV, prints `Uint32`; no type of std_msgs starts like that.
    """
    camel = "".join(word[:1].upper() + word[1:] for word in name.split("_"))
    if package == "std_msgs" and camel.startswith("Uint"):
        camel = f"UInt{camel.removeprefix('Uint')}"
    return f"{package}/{kind}/{camel}"


def inline_message_type(text: str) -> str:
    """Return the ROS 2 name of a message type written `pkg/Type` or `pkg/msg/Type`, else ValueError."""
    match text.split("/"):
        case [package, name] | [package, "msg", name] if package and name:
            return ros_type_name(package, "msg", name)
        case _:
            raise ValueError(f"{text!r} is no message type of the form `pkg/Type`.")

# SPDX-License-Identifier: GPL-2.0-or-later
"""A subscriber on Cyclone DDS for Python, with the types and settings of ROS 2.

    read.py DOMAIN COUNT default|sensor TOPIC=TYPE…    for example neck/measured_cp=PoseStamped

Prints JSON: for each TOPIC its first COUNT messages as lists of numbers and texts in their order, and the
user data of its writer. The settings are those of a subscription by default, or for sensor data. Texts are
read as a late subscriber does, with transient local durability, and one of them is enough.
"""
import dataclasses
import json
import sys
import time
from types import new_class

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, annotations, types
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

FLOAT, RELIABLE = types.float64, Policy.Reliability.Reliable(10**9)


def message(package, name, /, **fields):
    """A class of package/msg/name."""
    typename = {"typename": f"{package}::msg::dds_::{name}_"}
    made = new_class(name, (IdlStruct,), typename, lambda space: space.update(__annotations__=fields))
    return annotations.final(dataclasses.dataclass(made))


def vector(name):
    return message("geometry_msgs", name, x=FLOAT, y=FLOAT, z=FLOAT)


TIME = message("builtin_interfaces", "Time", sec=types.int32, nanosec=types.uint32)
HEADER = message("std_msgs", "Header", stamp=TIME, frame_id=str)
QUATERNION = message("geometry_msgs", "Quaternion", x=FLOAT, y=FLOAT, z=FLOAT, w=FLOAT)
POSE = message("geometry_msgs", "Pose", position=vector("Point"), orientation=QUATERNION)
WRENCH = message("geometry_msgs", "Wrench", force=vector("Vector3"), torque=vector("Vector3"))
TYPES = {
    "PoseStamped": message("geometry_msgs", "PoseStamped", header=HEADER, pose=POSE),
    "WrenchStamped": message("geometry_msgs", "WrenchStamped", header=HEADER, wrench=WRENCH),
    "Log": message(
        "rcl_interfaces", "Log", stamp=TIME, level=types.byte, name=str, msg=str, file=str, function=str,
        line=types.uint32,
    ),
}


def flat(value):
    if not dataclasses.is_dataclass(value):
        return [value]
    return [x for field in dataclasses.fields(value) for x in flat(getattr(value, field.name))]


def settings(kind, name):
    if name == "Log":
        return Qos(RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))
    if kind == "sensor":
        return Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(5))
    return Qos(RELIABLE, Policy.History.KeepLast(10))


def user_data(participant, topic):
    for sample in BuiltinDataReader(participant, BuiltinTopicDcpsPublication).take(100):
        if sample.topic_name == topic and Policy.Userdata in sample.qos:
            return bytes(sample.qos[Policy.Userdata].data).decode()
    return ""


def main(domain, count, kind, *topics):
    participant = DomainParticipant(int(domain))
    readers, found = {}, {}
    for topic, name in (pair.split("=") for pair in topics):
        made = Topic(participant, "rt/" + topic, TYPES[name])
        reader = DataReader(participant, made, qos=settings(kind, name))
        readers[topic] = (reader, 1 if name == "Log" else int(count))
        found[topic] = {"messages": []}
    end = time.monotonic() + 300
    while any(len(found[topic]["messages"]) < n for topic, (_, n) in readers.items()):
        if time.monotonic() > end:
            sys.exit(f"only { {topic: len(one['messages']) for topic, one in found.items()} } in 300 s")
        for topic, (reader, _) in readers.items():
            found[topic]["messages"] += [flat(sample) for sample in reader.take(100)]
        time.sleep(0.002)
    for topic, one in found.items():
        one["user_data"] = user_data(participant, "rt/" + topic)
    json.dump(found, sys.stdout)


main(*sys.argv[1:])

# SPDX-License-Identifier: GPL-2.0-or-later
"""
The object dictionary of the drive, as CiA 301 and CiA 402 (IEC 61800-7-201) list it.

One line per object: index, sub, type, access, value at power-on, name. A line whose access
ends in "m" may be mapped into a PDO. $NODE is the node id.
"""

from canopen import ObjectDictionary
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

TYPES = {
    "u8": datatypes.UNSIGNED8, "u16": datatypes.UNSIGNED16, "u32": datatypes.UNSIGNED32,
    "i8": datatypes.INTEGER8, "i16": datatypes.INTEGER16, "i32": datatypes.INTEGER32,
    "text": datatypes.VISIBLE_STRING,
}

# A turn of the screw: 51200 counts. 6091 is 1:1.
TABLE = """
1000 0 u32  const 0x00420192  device type
1001 0 u8   rom   0           error register
1005 0 u32  rw    0x80        COB-ID SYNC
1008 0 text const incise-test-drive  device name
1009 0 text const 1           hardware version
100A 0 text const 1           software version
1014 0 u32  rw    $NODE+0x80  COB-ID EMCY
1015 0 u16  rw    0           inhibit time EMCY
1016 0 u8   const 1           consumers
1016 1 u32  rw    0           consumer heartbeat time
1017 0 u16  rw    0           producer heartbeat time
1018 0 u8   const 4           entries
1018 1 u32  ro    0x00001CE5  vendor
1018 2 u32  ro    0x00000402  product
1018 3 u32  ro    0x00010002  revision
1018 4 u32  ro    0x0000BEEF  serial number
1029 0 u8   const 1           error classes
1029 1 u8   rw    0           communication error
6007 0 i16  rw    1           abort connection option
603F 0 u16  rom   0           error code
6040 0 u16  rwm   0           controlword
6041 0 u16  rom   0           statusword
605A 0 i16  rw    2           quick stop option
605B 0 i16  rw    0           shutdown option
605C 0 i16  rw    1           disable operation option
605E 0 i16  rw    2           fault reaction option
6060 0 i8   rwm   0           mode of operation
6061 0 i8   rom   0           mode of operation display
6064 0 i32  rom   0           position actual value
6065 0 u32  rw    2000        following error window
6066 0 u16  rw    10          following error time
606C 0 i32  rom   0           velocity actual value
6071 0 i16  rwm   0           target torque
6072 0 u16  rwm   1000        max torque
6076 0 u32  ro    1000        motor rated torque
6077 0 i16  rom   0           torque actual value
607A 0 i32  rwm   0           target position
607C 0 i32  rw    0           home offset
607D 0 u8   const 2           entries
607D 1 i32  rw    0           min position limit
607D 2 i32  rw    0           max position limit
607F 0 u32  rw    0xFFFFFFFF  max profile velocity
6083 0 u32  rw    1000000     profile acceleration
6084 0 u32  rw    1000000     profile deceleration
6085 0 u32  rw    5000000     quick stop deceleration
608F 0 u8   const 2           entries
608F 1 u32  rw    51200       encoder increments
608F 2 u32  rw    1           motor revolutions
6091 0 u8   const 2           entries
6091 1 u32  rw    1           motor shaft revolutions
6091 2 u32  rw    1           driving shaft revolutions
6092 0 u8   const 2           entries
6092 1 u32  rw    51200       feed
6092 2 u32  rw    1           shaft revolutions
6098 0 i8   rw    0           homing method
6099 0 u8   const 2           entries
6099 1 u32  rw    51200       speed to search for a switch
6099 2 u32  rw    10240       speed to search for zero
609A 0 u32  rw    1000000     homing acceleration
60A9 0 u32  rw    0           SI unit velocity
60AA 0 u32  rw    0           SI unit acceleration
60B0 0 i32  rwm   0           position offset
60B1 0 i32  rwm   0           velocity offset
60B2 0 i16  rwm   0           torque offset
60C2 0 u8   const 2           entries
60C2 1 u8   rw    1           interpolation time period value
60C2 2 i8   rw    -3          interpolation time index
60C5 0 u32  rw    100000000   max acceleration
60C6 0 u32  rw    100000000   max deceleration
60F4 0 i32  rom   0           following error actual value
60FD 0 u32  rom   0           digital inputs
60FF 0 i32  rwm   0           target velocity
6502 0 u32  ro    0x000003A0  supported drive modes
"""

# Communication and mapping of four PDOs each way: defaults of CiA 402's generic ones.
PDOS = (
    (0x1400, 0x1600, 0x200, 255, (0x60400010,)),
    (0x1401, 0x1601, 0x300, 255, (0x60400010, 0x60600008)),
    (0x1800, 0x1A00, 0x180, 255, (0x60410010,)),
    (0x1801, 0x1A01, 0x280, 255, (0x60410010, 0x60610008)),
)
MAPPED_MOST = 8


def _value(text, kind, node):
    if kind == "text":
        return text
    if text.startswith("$NODE+"):
        return node + int(text[6:], 0)
    return int(text, 0)


def _add(od, index, sub, kind, access, value, name):
    var = ODVariable(f"{name} {index:04X}:{sub}", index, sub)
    var.data_type = TYPES[kind]
    var.pdo_mappable = access.endswith("m")
    var.access_type = access.rstrip("m") if access != "rom" else "ro"
    var.default = value
    if index not in od:
        od.add_object(ODRecord(f"{name} {index:04X}", index))
    od[index].add_member(var)


def _add_pdo(od, com, mapping, cob, kind, mapped, node):
    _add(od, com, 0, "u8", "const", 5, "PDO")
    _add(od, com, 1, "u32", "rw", (0x40000000 if com >= 0x1800 else 0) + cob + node, "COB-ID")
    _add(od, com, 2, "u8", "rw", kind, "transmission type")
    _add(od, com, 3, "u16", "rw", 0, "inhibit time")
    _add(od, com, 5, "u16", "rw", 0, "event timer")
    _add(od, mapping, 0, "u8", "rw", len(mapped), "mapped")
    for i in range(MAPPED_MOST):
        entry = mapped[i] if i < len(mapped) else 0
        _add(od, mapping, i + 1, "u32", "rw", entry, f"entry {i + 1}")


def dictionary(node, changed=(), without=()):
    """
    The whole dictionary. changed: {(index, sub): value at power-on}; without: what this
    drive lacks, (index, sub) or (index, None) for all of it.
    """
    od = ObjectDictionary()
    for line in TABLE.split("\n"):
        if not line:
            continue
        index, sub, kind, access, rest = line.split(None, 4)
        text, name = rest.split(None, 1)
        _add(od, int(index, 16), int(sub), kind, access, _value(text, kind, node), name)
    for pdo in PDOS:
        _add_pdo(od, *pdo, node)
    for (index, sub), value in dict(changed).items():
        od[index][sub].default = value
    for index in (0x60A9, 0x60AA):  # only who gives a unit has one
        if not od[index][0].default:
            del od[index]
    for index, sub in without:
        if index not in od:
            continue
        if sub is None:
            del od[index]
        else:
            del od[index][sub]
    for index in list(od):
        if list(od[index]) == [0]:  # a variable, not a record of one
            od.add_object(od[index][0])
    return od

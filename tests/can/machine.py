# SPDX-License-Identifier: GPL-2.0-or-later
"""
The drive itself, by CiA 402 (IEC 61800-7-201): state machine, modes, limits, and a shaft
that is at its target one cycle later. It has no bus and no clock: callers pass the elapsed
time. Units: counts, s.

    shaft    where the screw stands in the machine; position = shaft - zero
    span     the limit switches, on the shaft
"""

STATES = {
    "not ready": 0x00, "switch-on disabled": 0x40, "ready": 0x21, "switched on": 0x23,
    "operation enabled": 0x27, "quick stop": 0x07, "fault reaction": 0x0F, "fault": 0x08,
}
NO_POWER = ("not ready", "switch-on disabled", "ready", "fault")
HOMING, CSP, CSV, CST = 6, 8, 9, 10

# Table of transitions: (state, command) -> state. Number of the standard's in the comment.
STEPS = {
    ("switch-on disabled", "shutdown"): "ready",  # 2
    ("ready", "switch on"): "switched on",  # 3
    ("ready", "enable"): "switched on",  # 3, then 4
    ("switched on", "enable"): "operation enabled",  # 4
    ("operation enabled", "switch on"): "switched on",  # 5: disable operation
    ("switched on", "shutdown"): "ready",  # 6
    ("ready", "disable voltage"): "switch-on disabled",  # 7
    ("ready", "quick stop"): "switch-on disabled",  # 7
    ("operation enabled", "shutdown"): "ready",  # 8
    ("operation enabled", "disable voltage"): "switch-on disabled",  # 9
    ("switched on", "disable voltage"): "switch-on disabled",  # 10
    ("switched on", "quick stop"): "switch-on disabled",  # 10
    ("operation enabled", "quick stop"): "quick stop",  # 11
    ("quick stop", "disable voltage"): "switch-on disabled",  # 12
}

# Homing methods: towards the negative or the positive limit switch.
HOME_DOWN, HOME_UP, HOME_HERE = (1, 17), (2, 18), (35, 37)


def command(word):
    """The command of a controlword, by its bits 0 to 3; bit 7 is handled elsewhere."""
    if not word & 0x02:
        return "disable voltage"
    if not word & 0x04:
        return "quick stop"
    if not word & 0x01:
        return "shutdown"
    return "enable" if word & 0x08 else "switch on"


class Machine:
    def __init__(self, get, tell, span=(-20000, 600000), shaft=0):
        """get(index, sub): an object's value; tell(what): events, for the record."""
        self.get = get
        self.tell = tell
        self.span = span
        self.shaft = float(shaft)
        self.blocked = False
        self.forced_inputs = None
        self.fault_stays = False
        self.power_on()

    def power_on(self):
        """As after mains came: no fault, no mode, not homed; the shaft stays where it is."""
        self.state = "switch-on disabled"
        self.mode = 0
        self.word = 0
        self.zero = 0.0
        self.velocity = 0.0
        self.torque = 0
        self.demand = None
        self.homed = False
        self.homing = False
        self.home_failed = False
        self.error = 0
        self.following_s = 0.0
        self.following = False
        self.limit_active = False

    # Measured values.

    @property
    def position(self):
        return round(self.shaft - self.zero)

    @property
    def inputs(self):
        if self.forced_inputs is not None:
            return self.forced_inputs
        at_min, at_max = self.shaft <= self.span[0], self.shaft >= self.span[1]
        return at_min | at_max << 1

    @property
    def statusword(self):
        word = STATES[self.state] | 0x0210  # remote, voltage
        word |= 0x0800 if self.limit_active else 0
        if self.mode == HOMING:
            word |= 0 if self.homing else 0x0400
            word |= 0x1000 if self.homed else 0
            word |= 0x2000 if self.home_failed else 0
        elif self.state == "operation enabled":
            word |= 0x1000  # it follows its set-points
            word |= 0x2000 if self.following else 0
        return word

    @property
    def counts_per_turn(self):
        return self.get(0x6092, 1) / self.get(0x6092, 2)

    def _unit(self, index):
        """counts/s or counts/s² of a unit of velocity or acceleration (60A9, 60AA)."""
        unit = self.get(index, 0)
        if not unit:
            return 1.0
        prefix = (unit >> 24) - (256 if unit >> 31 else 0)
        length = {0xB4: self.counts_per_turn, 0xB5: 1.0}[unit >> 16 & 0xFF]
        per = {0x03: 1.0, 0x47: 60.0, 0x57: 1.0}[unit >> 8 & 0xFF]
        return length / per * 10.0 ** prefix

    @property
    def velocity_unit(self):
        return self._unit(0x60A9)

    @property
    def acceleration_unit(self):
        return self._unit(0x60AA)

    # Commands.

    def _go(self, state, why):
        if state == self.state:
            return
        self.tell(f"{self.state} -> {state}: {why}")
        if state == "operation enabled":
            self.demand = None
            self.homing = False
        self.state = state
        if state in NO_POWER or state == "switched on":
            self.velocity = 0.0
            self.demand = None
            self.homing = False

    def control(self, word):
        """A controlword came."""
        before, self.word = self.word, word
        rising = word & ~before
        if self.state == "fault":
            if rising & 0x80 and not self.fault_stays:
                self.error = 0
                self._go("switch-on disabled", "fault reset")  # 15
            return
        if word & 0x80:
            return  # bit 7 belongs to no other command
        what = command(word)
        if what == "quick stop" and self.state == "operation enabled":
            self.quick_stop("commanded")
            return
        if what == "enable" and self.state == "quick stop" and self.get(0x605A, 0) >= 5:
            self._go("operation enabled", what)  # 16
            return
        while (self.state, what) in STEPS:
            self._go(STEPS[self.state, what], what)
        if self.state == "operation enabled" and self.mode == HOMING:
            self._home(rising, word)

    def quick_stop(self, why):
        """By command or by an abort of the connection."""
        if self.state != "operation enabled":
            if self.state in ("switched on", "ready"):
                self._go("switch-on disabled", f"quick stop, {why}")
            return
        option = self.get(0x605A, 0)
        self._go("quick stop" if option else "switch-on disabled", f"quick stop, {why}")

    def fault(self, code, why):
        """Something is broken: transition 13, and 14 when it stands."""
        if self.state in ("fault", "fault reaction"):
            return
        self.error = code
        powered = self.state not in NO_POWER
        self._go("fault reaction", why)
        if not powered or self.get(0x605E, 0) == 0:
            self._go("fault", "reaction done")

    def abort_connection(self, why):
        """The master is gone: what object 6007 says."""
        option = self.get(0x6007, 0)
        if option == 1:
            self.fault(0x8130, why)
        elif option == 2 and self.state not in ("fault", "fault reaction", "not ready"):
            self._go("switch-on disabled", f"disable voltage, {why}")
        elif option == 3:
            self.quick_stop(why)

    # Motion.

    def _home(self, rising, word):
        if rising & 0x10:
            self.homing, self.homed, self.home_failed = True, False, False
            self.tell(f"homing by method {self.get(0x6098, 0)}")
        elif not word & 0x10 and self.homing:
            self.homing, self.velocity = False, 0.0
            self.tell("homing interrupted")

    def _homing_step(self, dt):
        method = self.get(0x6098, 0)
        if method in HOME_HERE:
            self._home_found(self.shaft)
        elif method in HOME_DOWN or method in HOME_UP:
            down = method in HOME_DOWN
            speed = self.get(0x6099, 1) * self.velocity_unit
            self.velocity = 0.0 if self.blocked else -speed if down else speed
            self.shaft += self.velocity * dt
            edge = self.span[0] if down else self.span[1]
            if (self.shaft <= edge) if down else (self.shaft >= edge):
                # It backs off at 6099:2 to where the switch lets go: one count inside.
                self.shaft = float(edge + 1 if down else edge - 1)
                self._home_found(self.shaft)
        else:
            self.homing, self.home_failed, self.velocity = False, True, 0.0
            self.tell("no such homing method")

    def _home_found(self, shaft):
        self.zero = shaft - self.get(0x607C, 0)
        self.velocity = 0.0
        self.homing, self.homed = False, True
        self.tell(f"homed at shaft {round(shaft)}")

    def _clamp(self, value, least, most):
        held = min(max(value, least), most)
        self.limit_active = self.limit_active or held != value
        return held

    def _follow_position(self, dt):
        """One cycle of CSP: reach the last target, within 607F."""
        if self.demand is None:
            self.demand = float(self.position)
        before = self.shaft
        step = self.demand - (self.shaft - self.zero)
        most = self.get(0x607F, 0) * self.velocity_unit * dt
        step = self._clamp(step, -most, most)
        if not self.blocked:
            self.shaft += step
        self.velocity = (self.shaft - before) / dt
        self._watch_following(dt)

    def _watch_following(self, dt):
        window = self.get(0x6065, 0)
        off = abs(self.demand - (self.shaft - self.zero))
        self.following = window != 0xFFFFFFFF and off > window
        self.following_s = self.following_s + dt if self.following else 0.0
        if self.following and self.following_s * 1000 >= self.get(0x6066, 0):
            self.fault(0x8611, f"following error {off:.0f} counts")

    def synced(self, dt):
        """
        A SYNC came, and a cycle went by: the shaft has reached the target of the last one;
        that of this one becomes what it goes for.
        """
        if self.state != "operation enabled" or self.mode != CSP:
            return
        self.limit_active = False
        self._follow_position(dt)
        target = float(self.get(0x607A, 0))
        low, high = self.get(0x607D, 1), self.get(0x607D, 2)
        self.demand = self._clamp(target, low, high) if low < high else target

    def advance(self, dt):
        """Time goes by: what moves without SYNC."""
        if self.state in ("quick stop", "fault reaction"):
            self._ramp(dt)
        elif self.state == "operation enabled" and self.mode == HOMING and self.homing:
            self._homing_step(dt)
        elif self.state == "operation enabled" and self.mode == CSV:
            self._follow_velocity(dt)
        elif self.state == "operation enabled" and self.mode == CST:
            self._follow_torque(dt)

    def _ramp(self, dt):
        slow = self.get(0x6085, 0) * self.acceleration_unit * dt
        self.velocity -= min(abs(self.velocity), slow) * (1 if self.velocity > 0 else -1)
        self.shaft += self.velocity * dt
        if self.velocity:
            return
        if self.state == "fault reaction":
            self._go("fault", "it stands")  # 14
        elif self.get(0x605A, 0) < 5:
            self._go("switch-on disabled", "it stands")  # 12

    def _follow_velocity(self, dt):
        most = self.get(0x607F, 0) * self.velocity_unit
        target = (self.get(0x60FF, 0) + self.get(0x60B1, 0)) * self.velocity_unit
        self.limit_active = False
        self.velocity = 0.0 if self.blocked else self._clamp(target, -most, most)
        self.shaft += self.velocity * dt

    def _follow_torque(self, dt):
        """A mass with friction: full torque gives 5e6 counts/s² and at most 1e6 counts/s."""
        most = self.get(0x6072, 0)
        self.limit_active = False
        self.torque = self._clamp(self.get(0x6071, 0) + self.get(0x60B2, 0), -most, most)
        if self.blocked:
            self.velocity = 0.0
            return
        self.velocity += (self.torque * 5000.0 - self.velocity * 5.0) * dt
        self.shaft += self.velocity * dt

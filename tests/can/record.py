# SPDX-License-Identifier: GPL-2.0-or-later
"""The master as seen by the drive: counts, times between SYNCs, steps of the set-points."""

from array import array

EVENTS_MOST = 2000
GAPS_MOST = 1000000


class Record:
    def __init__(self, now):
        self.start = now
        self.events = []
        self.restart()

    def restart(self):
        """Counts from here on; events are kept."""
        self.syncs = self.rpdos = self.tpdos = 0
        self.missing = 0  # SYNCs without a set-point before them, with power
        self.doubled = 0  # set-points of which only the last counted
        self.enabled_rpdos = 0  # that came with power
        self.largest_step = 0
        self.sdos = 0
        self.heartbeats = 0  # of the master
        self.emcys = 0
        self.gaps = array("d")
        self.last_sync = None
        self.last_target = None
        self.pending = 0
        self.silence_ms = None  # from the last heartbeat to the reaction to its loss
        self.first_sdo = None
        self.start_ms = None  # from the first SDO to operation enabled

    def event(self, now, what):
        if len(self.events) < EVENTS_MOST:
            self.events.append({"ms": round((now - self.start) * 1000, 1), "what": what})

    def sdo(self, now):
        self.sdos += 1
        if self.first_sdo is None:
            self.first_sdo = now

    def enabled(self, now):
        if self.first_sdo is not None and self.start_ms is None:
            self.start_ms = round((now - self.first_sdo) * 1000, 1)

    def set_point(self, enabled):
        self.rpdos += 1
        self.pending += 1
        if enabled:
            self.enabled_rpdos += 1

    def sync(self, now, enabled, target):
        """target: None where there is none of positions."""
        self.syncs += 1
        if self.last_sync is not None and len(self.gaps) < GAPS_MOST:
            self.gaps.append(now - self.last_sync)
        self.last_sync = now
        if enabled and self.pending == 0:
            self.missing += 1
        if self.pending > 1:
            self.doubled += self.pending - 1
        self.pending = 0
        if not enabled or target is None:
            self.last_target = None
            return
        if self.last_target is not None:
            step = target - self.last_target
            self.largest_step = max(self.largest_step, abs(step))
        self.last_target = target

    def _gaps(self):
        if not self.gaps:
            return None
        ordered = sorted(self.gaps)
        pick = lambda part: round(ordered[int(part * (len(ordered) - 1))] * 1000, 4)
        return {"median_ms": pick(0.5), "p99_ms": pick(0.99), "max_ms": pick(1)}

    def report(self):
        names = ("syncs", "rpdos", "enabled_rpdos", "tpdos", "missing", "doubled",
                 "largest_step", "sdos", "heartbeats", "emcys", "silence_ms",
                 "start_ms")
        made = {name: getattr(self, name) for name in names}
        made["between_syncs"] = self._gaps()
        return made

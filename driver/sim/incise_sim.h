/* SPDX-License-Identifier: (GPL-2.0-only WITH Linux-syscall-note) OR LGPL-2.1-or-later */
/*
 * Shared by incise_sim.ko, the simulated GPIO chip and ADC of the tests,
 * with programs in user space. All of it lives in debugfs, in the folder
 * INCISE_SIM_DIR; a write that is not understood is refused with EINVAL and
 * changes nothing.
 *
 *  edges     read    struct incise_sim_edge, oldest first. Reading drains: an
 *                    edge is handed out once; 0 bytes say "none now". A read
 *                    of less than one edge is EINVAL.
 *            write   "reset": forgets all edges, counts from 0 again
 *  status    read    lines "name=number": see below
 *  inputs    write   "LINE VALUE", as many pairs as wanted, one per line;
 *                    all are applied at once. A line that is an output now
 *                    takes the value when it becomes an input.
 *            read    "LINE in|out LEVEL" of every line
 *  carriage  write   "number=0 step=0 dir=1 enable=2 min=3 max=4 home=5
 *                    min_at=-100 max_at=5000 home_at=0..20 position=0
 *                    inverted=step,min": mechanics behind a step and a
 *                    direction line. All but step and dir may be left out;
 *                    number is 0 to 7. "number=0 off" removes one, "off" all.
 *                    "ignore=100": it stands still for the next 100 steps
 *            read    one line per carriage, the same words and
 *                    steps= up= down= ignored= lowest= highest=
 *  scripts   write   "after=K line=L set=M value=V": after K more edges of
 *                    line L input M is driven to V, inside that edge; with
 *                    "edge=rising" or "edge=falling" only these are counted.
 *                    "clear" removes all.
 *            read    one line per script, with left= and fired_ns=
 *  faults    write   what is wrong with the chip, in one word:
 *                    "interrupts=held"    they stay pending …
 *                    "interrupts=come"    … until then; has come on return
 *                    "interrupts=none"    a line has none: ENXIO
 *                    "interrupts=refused" asking for one gives EIO
 *                    "unreadable=LINE"    reading its level gives EIO
 *                    "none"               nothing is
 *  sleep     write   "suspend=DEVICE", "resume=DEVICE": calls that function
 *                    of the driver of a platform device, as a suspend of the
 *                    machine does, and gives its error.
 *                    "awake=DEVICE": that device of the PCI bus stays awake
 *                    when the machine sleeps, until the next boot
 *
 * status: lines, edges (all that ever were, since reset), held (in the ring),
 * lost (the ring was full: the newest are lost), ring (its size), repeats
 * (set() to the level that was there already), interrupts (delivered).
 *
 * A carriage moves with the active edge of step, up when dir is active, and
 * stands still (ignored=) while its enable line, if it has one, is inactive.
 * Its limits are driven inside the edge that reached them:
 *
 *	  min active              home                    max active
 *	 ------------|         |--------|              |------------
 *	          min_at     home_at: from..to       max_at        position
 *
 * The ADC is the IIO device INCISE_SIM_ADC: channel voltage0 (12 bits, mV =
 * (raw - 2048) * 5000 / 4096) and timestamp, trigger INCISE_SIM_TRIGGER
 * (current by default), sampling_frequency 1 to 20000 Hz at both.
 *
 *  adc/waveform write   __u16 raw codes 0 to 4095, appended to those that are
 *                       queued; may be taken in part, ENOSPC when 2^20 are
 *                       queued
 *  adc/control  write   "repeat": what is queued is played again and again,
 *                       from its start when a buffer is enabled (default)
 *                       "once": each is played once and makes room
 *                       "clear": nothing is queued
 *                       "reset": all counts of adc/status to 0
 *  adc/status   read    conversions = pushed + held + overflows + lost
 *
 * pushed (given to IIO, or read by in_voltage0_raw), held (not yet given),
 * overflows (IIO's buffer was full), lost (256 were held), skipped (periods
 * without a conversion, the timer was late), underruns (nothing was queued, the
 * last code was converted again), queued, mode.
 */
#ifndef INCISE_SIM_H
#define INCISE_SIM_H

#include <linux/types.h>

#define INCISE_SIM_LABEL "incise-sim"
#define INCISE_SIM_DIR "/sys/kernel/debug/incise_sim"

#define INCISE_SIM_ADC "incise-sim-adc"
#define INCISE_SIM_TRIGGER "incise-sim-timer"

#define INCISE_SIM_LINES_MAX 256
#define INCISE_SIM_CARRIAGES 8
#define INCISE_SIM_SCRIPTS 64
#define INCISE_SIM_ADC_WAVEFORM 1048576
#define INCISE_SIM_ADC_MAX 4095
#define INCISE_SIM_ADC_ZERO 2048
#define INCISE_SIM_ADC_HZ_MAX 20000

/* The line is an input; the change came from the simulator, not from set(). */
#define INCISE_SIM_EDGE_INPUT 0x01

/*
 * The line became an output or an input: value is its level now, which may be
 * the one it had. Says with which level a log starts.
 */
#define INCISE_SIM_EDGE_CONFIGURED 0x02

/**
 * struct incise_sim_edge - one change of a line
 * @t_ns:	CLOCK_MONOTONIC; never less than that of the edge before
 * @sequence:	counts all edges from 0 at reset, lost ones too: a gap is a
 *		loss; wraps after 2^32
 * @line:	offset of the line
 * @value:	its level from now on, 0 or 1
 * @flags:	INCISE_SIM_EDGE_*
 */
struct incise_sim_edge {
	__s64 t_ns;
	__u32 sequence;
	__u16 line;
	__u8 value;
	__u8 flags;
};

#endif

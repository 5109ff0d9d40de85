/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The bytes of a state page, as incise-state(5) documents them. Numbers are in the machine's
 * byte order, of 8 bytes unless stated otherwise; strings end with 0.
 *
 *   0 ┌──────────────┐
 *     │ head         │ constant
 *     ├──────────────┤
 *     │ seq │ run    │ by the normal thread
 *     ├──────────────┤
 *     │ seq │ live   │ by the loop at each tick
 *     ├──────────────┤
 *     │ lateness     │ 961 counters each
 *     │ cost         │
 *     ├──────────────┤
 *     │ head of ring │ ticks written; tick n is in slot n % slots
 *     │ slots        │ number + 1, tick
 *     └──────────────┘
 *
 * It is there twice: in memory of the writer's own, where the loop writes it, and in the file,
 * to which a thread of the writer copies it.
 *
 * The head has the place and size of each part. Parts only grow within a major version;
 * readers use the beginning that they know.
 *
 * Each word behind the head is written as an atomic, so that a race is a torn copy, which seq
 * reveals, and never undefined. The pattern is from H.-J. Boehm, 'Can seqlocks get along with
 * programming language memory models?', MSPC 2012, figure 6; as in device/page.c.
 *
 *   writer   seq odd ── words ── seq even         one at a time per part
 *   reader   seq even ── copy ── the same seq     else once more
 */
#ifndef INCISE_STATE_PAGE_H
#define INCISE_STATE_PAGE_H

#include <stdint.h>
#include <incise/state.h>

#define STATE_MAGIC "INCSTATE"
#define STATE_MAJOR 1
#define STATE_MINOR 0
#define STATE_FLAGS 16	/* counters of flags, some unused */
#define STATE_STAGES 16 /* a plan with more has the first of them here */

struct state_part {
	uint64_t offset; /* from the beginning of the page, a multiple of 8 */
	uint64_t size;	 /* bytes; of the histograms and the ring, of one entry */
	uint64_t count;	 /* entries */
};

struct state_head {
	char magic[8];
	uint32_t major, minor;
	uint64_t size; /* of the page */
	struct state_part head, run, live, lateness, cost, ring;
	int64_t pid;
	int64_t start_ns, start_realtime_ns;
	double rate_hz;
	char rig[256];
	char policy[128];
};

/* As struct incise_tick, in fixed widths. */
struct state_tick {
	int64_t t_ns;
	double position_mm[3], tool_mm[3], proxy_mm[3], normal[3];
	double quaternion[4];
	double depth_mm, velocity_mm_s;
	double command_N[3], actuated_N, rendered_N; /* of the first actuator */
	uint32_t flags;
	uint16_t phase, tool;
};

struct state_run {
	uint64_t seq;
	uint32_t run; /* enum incise_run */
	uint32_t n_stages;
	int64_t since_ns;
	char reason[304]; /* the last 4 are unused */
	char scene[512];
	char stage[STATE_STAGES][24];
	uint64_t left_out, reloads, refused;
	uint64_t minor_faults, major_faults, voluntary, involuntary;
};

struct state_live {
	uint64_t seq;
	uint64_t ticks, skipped, overruns, limited;
	uint64_t flagged[STATE_FLAGS];
	double force_N, force_max_N;
	int64_t lateness_ns, lateness_max_ns, cost_ns, cost_max_ns;
	double absorbed_mJ, returned_mJ;
	uint64_t lateness_sum_ns, cost_sum_ns;
	int64_t first_ns;
	struct state_tick tick;
};

struct state_slot {
	uint64_t number; /* of the tick, from 1 on; 0: no tick */
	struct state_tick tick;
};

struct state_page {
	struct state_head head;
	_Alignas(64) struct state_run run;
	_Alignas(64) struct state_live live;
	_Alignas(64) uint64_t lateness[INCISE_STATE_BUCKETS];
	uint64_t cost[INCISE_STATE_BUCKETS];
	/* Number of ticks written, then the slots. */
	_Alignas(64) uint64_t written;
	struct state_slot slot[INCISE_STATE_TICKS];
};

/* Readers from other compilers rely on these sizes. */
_Static_assert(sizeof(struct state_head) == 584, "head");
_Static_assert(sizeof(struct state_tick) == 200, "tick");
_Static_assert(sizeof(struct state_run) == 1280, "run");
_Static_assert(sizeof(struct state_live) == 456, "live");
_Static_assert(sizeof(struct state_slot) == 208, "slot");
_Static_assert(INCISE_TICK_FLAGS <= STATE_FLAGS, "a counter for each flag");

/* Between the page's tick and the library's. */
void incise_state_pack(struct state_tick *to,
		       const struct incise_tick *from) INCISE_REALTIME;
/* Returns 0; -EIO: @from is no tick. */
int incise_state_unpack(struct incise_tick *to, const struct state_tick *from);

/*
 * Publish a tick. Real-time safe: 35 ns with the page in the cache, half a us without; no
 * allocation, lock or system call. In the thread that ticks, only.
 *
 * The tissue's work is summed here: the force that one tick requested, along the way to the
 * place of the tool at the next one. Ways that are no motion are left out: from one tool to
 * another, to or from a tick without a fresh pose or with a fault.
 *
 * @writer      NULL: nothing happens
 * @lateness_ns from the time that the tick was due to its start; below 0 counts as 0
 * @cost_ns     duration of the tick
 * @skipped     ticks that were left out just before this one; an overrun when not 0
 */
void incise_state_tick(struct incise_state_writer *writer, const struct incise_tick *tick,
		       int64_t lateness_ns, int64_t cost_ns,
		       uint64_t skipped) INCISE_REALTIME;

/*
 * Copy the loop's published state to the file now; the writer's own thread does so every few
 * milliseconds. For the normal thread.
 */
void incise_state_mirror(struct incise_state_writer *writer);

/* The bucket of a time; times below 0 are in the first. */
int incise_state_bucket(int64_t ns) INCISE_REALTIME;

#endif

/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The state of a loop, in a page of shared memory: the loop writes it, anybody reads it, and
 * neither waits for the other.
 *
 *     loop's thread ── tick ──────────▶ live part, histograms, ring ──╮
 *     normal thread ── run, scene … ──▶ run part ─────────────────────┤ FILE
 *                                                                     ╰──▶ any reader
 *
 * The page is a file, best on a tmpfs: /run/incise/NAME.state. Its writer holds a lock on it
 * for life, so that readers can tell a dead one, and leaves it in place at the end. The next
 * one puts its own file there. incise-state(5) has the bytes.
 */
#ifndef INCISE_STATE_H
#define INCISE_STATE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/plan.h>
#include <incise/realtime.h>

INCISE_BEGIN_DECLS

struct incise_state;
struct incise_state_writer;

/** What the program around the loop does. */
enum incise_run {
	INCISE_RUN_STARTING, /**< opens devices, tests itself: no ticks yet */
	INCISE_RUN_RUNNING,
	INCISE_RUN_RELOADING, /**< reads another scene; the old one ticks on */
	INCISE_RUN_STOPPING,  /**< the force fades to zero */
	INCISE_RUN_STOPPED,   /**< ended as it was asked to */
	INCISE_RUN_FAULT,     /**< ended by a fault: no force */
};
#define INCISE_RUNS 6 /**< how many there are */

/** "starting", "running" …; "unknown" for what is none. */
INCISE_API const char *incise_run_name(enum incise_run run);

#define INCISE_STATE_TICKS 8192 /**< that the ring holds: 8 s at 1 kHz */

/** What stays as it is for the life of a loop. */
struct incise_state_setup {
	double rate_hz;	    /**< asked for */
	const char *rig;    /**< as given: a file, or sim:…; or NULL */
	const char *policy; /**< in words: "SCHED_FIFO 80, CPU 1"; or NULL */
};

/**
 * Put a page at a path. All its memory is there and was written when this returns; to lock
 * it is the caller's mlockall(2). Its state is STARTING.
 *
 * @param path of a file in a folder that can be written; what is there must be a page, or
 *             empty
 * @return writer, to be freed with incise_state_free(); NULL with errno EBUSY (the writer
 *         of the page that is there lives: its pid is named), EEXIST (what is there is no
 *         page), EINVAL (rate not above 0), ENOSPC, ENOMEM, errno of open(2), rename(2).
 */
INCISE_API struct incise_state_writer *incise_state_new(
	const char *path, const struct incise_state_setup *setup,
	struct incise_error *err);

/**
 * Whether the page is in memory only (tmpfs, ramfs). On a disk the kernel may hold up the
 * loop while it writes the page out: not for real time.
 */
INCISE_API bool incise_state_in_memory(const struct incise_state_writer *writer);

/**
 * Tell of a tick. Real-time safe: 35 ns where its memory is in the cache, half a us where
 * not; no allocation, lock or system call. In the thread that ticks, only.
 *
 * The work of the tissue is counted here: the force that one tick asked for, along the way
 * to where the tool is at the next one. Ways that are no motion are left out: from one tool
 * to another, to or from a tick without a fresh pose or with a fault.
 *
 * @param writer      or NULL: nothing is done, here and below
 * @param lateness_ns from when the tick was due to when it began; below 0 counts as 0
 * @param cost_ns     how long it took
 * @param skipped     ticks that were left out just before this one; an overrun when not 0
 */
INCISE_API void incise_state_tick(struct incise_state_writer *writer,
				  const struct incise_tick *tick, int64_t lateness_ns,
				  int64_t cost_ns, uint64_t skipped) INCISE_REALTIME;

/**
 * Tell of a change of state. This and the functions below are the normal thread's.
 *
 * @param reason one line, cut at 299 bytes; NULL or "" for none
 */
INCISE_API void incise_state_run(struct incise_state_writer *writer, enum incise_run run,
				 const char *reason);

/**
 * Tell what is felt: before the first tick, and after each reload, which is counted.
 *
 * @param path of the scene; of a longer one than 511 bytes the end is kept
 * @param plan its stages; may be ticking. Or NULL: none are told
 */
INCISE_API void incise_state_scene(struct incise_state_writer *writer, const char *path,
				   const struct incise_plan *plan);

/** Tell that a reload was refused, and count it. @param reason in the place of the state's */
INCISE_API void incise_state_refused(struct incise_state_writer *writer,
				     const char *reason);

/** Tell what the loop's thread met: incise_realtime_count(). */
INCISE_API void incise_state_counts(struct incise_state_writer *writer,
				    const struct incise_realtime_counts *counts);

/** Let go of the page; the file stays, with what was told last. */
INCISE_API void incise_state_free(struct incise_state_writer *writer);

/**
 * Counts of times by how long they were. Up to 32 ns each has a bucket of its own; above,
 * each octave has 32, so that none is wider than 3.2 %; the last one is open, from 17.2 s on.
 */
#define INCISE_STATE_BUCKETS 961
/** How many durations fell into each bucket. */
struct incise_state_histogram {
	uint64_t count[INCISE_STATE_BUCKETS];
};

/** The bucket of a time; times below 0 are in the first. Real-time safe. */
INCISE_API int incise_state_bucket(int64_t ns) INCISE_REALTIME;

/** The longest time of a bucket, ns; INFINITY for the open one. Real-time safe. */
INCISE_API double incise_state_edge(int bucket) INCISE_REALTIME;

/** How many were counted. */
INCISE_API uint64_t incise_state_total(const struct incise_state_histogram *histogram);

/**
 * The time that a share of all were not longer than, ns: the longest of its bucket, so that
 * it is never too small, and at most 3.2 % too large.
 *
 * @param share 0 … 1
 * @return 0 when nothing was counted; INFINITY in the open bucket
 */
INCISE_API double incise_state_quantile(const struct incise_state_histogram *histogram,
					double share);

/** All that a page tells but the ring. Strings are printable, and end. */
struct incise_state_now {
	bool alive; /**< the writer lives; else this is what it told last */
	bool torn;  /**< it died while it wrote: some of this is older than the rest */

	int64_t pid;		   /**< of the writer */
	int64_t start_ns;	   /**< CLOCK_MONOTONIC when the page was made */
	int64_t start_realtime_ns; /**< CLOCK_REALTIME then */
	double rate_hz;
	char rig[256];
	char policy[128];

	enum incise_run run;
	int64_t since_ns; /**< CLOCK_MONOTONIC when it came to that; a reload is no end of it */
	char reason[300];
	char scene[512];
	int n_stages;
	char stage[INCISE_PLAN_STAGES_MAX][24];
	int left_out;	       /**< stages that the scene does not need */
	uint64_t reloads;      /**< done */
	uint64_t refused;      /**< reloads */
	uint64_t minor_faults; /**< pages mapped, by the loop's thread */
	uint64_t major_faults; /**< pages read from a disk */
	uint64_t voluntary;    /**< waits: one for each tick */
	uint64_t involuntary;  /**< times that another took the CPU from it */

	uint64_t ticks;
	uint64_t skipped;		     /**< ticks left out */
	uint64_t overruns;		     /**< times that some were */
	uint64_t flagged[INCISE_TICK_FLAGS]; /**< ticks with that flag */
	uint64_t limited;		     /**< ticks CLAMPED or SLEWED or both */
	double force_N, force_max_N;	     /**< size of the force asked for */
	int64_t lateness_ns, lateness_max_ns;
	int64_t cost_ns, cost_max_ns;
	uint64_t lateness_sum_ns, cost_sum_ns; /**< over all ticks */
	double absorbed_mJ;	 /**< work that the hand did on the tissue */
	double returned_mJ;	 /**< work that the tissue did on the hand, ≥ 0 */
	int64_t first_ns;	 /**< time of the first tick, by the loop's clock */
	struct incise_tick tick; /**< the last one */

	/** Not of the very same moment as the rest: a tick more or less. */
	struct incise_state_histogram lateness, cost;
};

/**
 * Open a page. What is in it is not trusted: whoever wrote it cannot make a reader fail
 * otherwise than with an errno. The file is read, not mapped: one that is cut off later
 * gives -EIO, and no signal.
 *
 * @return state, to be closed with incise_state_close(); NULL with errno of open(2), EINVAL
 *         (no page), EPROTO (of another version: the program and what wrote it are not of
 *         one release), ENOMEM.
 */
INCISE_API struct incise_state *incise_state_open(const char *path,
						  struct incise_error *err);

/**
 * Copy what a page tells.
 *
 * @return 0; -EAGAIN (it was being written each time one looked: look again), -EIO (it was
 *         cut off, or what stands there makes no sense). Some 6 system calls, never waits.
 */
INCISE_API int incise_state_read(struct incise_state *state,
				 struct incise_state_now *now);

#define INCISE_STATE_NEWEST UINT64_MAX /**< cursor of who wants ticks from now on only */

/**
 * Ticks since a reader looked last, oldest first. Any number of readers, each with a cursor
 * of its own: the number of the next tick, counted from 0.
 *
 * @param cursor 0: from the first that is there; INCISE_STATE_NEWEST: from now on. It is
 *               moved on
 * @param n      room in @ticks
 * @param lost   those that were overwritten before they were read are added; or NULL
 * @return how many ticks; -EIO as above. Never waits.
 */
INCISE_API int incise_state_ticks(struct incise_state *state, uint64_t *cursor,
				  struct incise_tick *ticks, int n, uint64_t *lost);

/** Whether the writer lives. @return 1 or 0; -EIO */
INCISE_API int incise_state_alive(struct incise_state *state);

/** NULL is accepted. The page stays. */
INCISE_API void incise_state_close(struct incise_state *state);

INCISE_END_DECLS
#endif

/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The status file of a loop: any process may read it, and the loop never waits for it.
 *
 *     loop's thread ── tick ──────────▶ live part, histograms, ring ──╮
 *     normal thread ── run, scene … ──▶ run part ─────────────────────┤ memory
 *                                       the writer's thread, each 5 ms ╰─▶ FILE ──▶ any reader
 *
 * The loop writes private memory, and a thread of the writer copies it to a file,
 * /run/incise/NAME.state. Another process that changes or truncates the file does not disturb
 * the loop; a truncated file is complete again after 5 ms. The writer holds a lock while it
 * runs, so that readers detect a dead writer, and leaves the file in place at the end. The
 * next writer replaces it. incise-state(5) documents the bytes.
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

/** Activity of the program around the loop. */
enum incise_run {
	INCISE_RUN_STARTING, /**< opens devices, self-test: no ticks yet */
	INCISE_RUN_RUNNING,
	INCISE_RUN_RELOADING, /**< reads another scene while the old one runs */
	INCISE_RUN_STOPPING,  /**< the force ramps to zero */
	INCISE_RUN_STOPPED,   /**< ended on request */
	INCISE_RUN_FAULT,     /**< ended by a fault: no force */
};
#define INCISE_RUNS 6 /**< number of states */

/** "starting", "running" …; "unknown" for other values. */
INCISE_API const char *incise_run_name(enum incise_run run);

#define INCISE_STATE_TICKS 8192 /**< capacity of the ring: 8 s at 1 kHz */

/** Constants of a loop. */
struct incise_state_setup {
	double rate_hz;	    /**< requested */
	const char *rig;    /**< as given: a file, or sim:…; or NULL */
	const char *policy; /**< in words: "SCHED_FIFO 80, CPU 1"; or NULL */
};

/**
 * Create a status file in state STARTING, and start the thread that writes it. Its memory is
 * resident afterwards; the caller locks it with mlockall(2).
 *
 * @param path file in a writable folder; an existing file must be a status file, or empty
 * @return writer, to be freed with incise_state_free(); NULL with errno EBUSY (the writer of
 *         the existing file is running; @err names its pid), EEXIST (the existing file is not
 *         a status file), EINVAL (rate not above 0), ENOSPC, ENOMEM, errno of open(2),
 *         rename(2), pthread_create(3).
 */
INCISE_API struct incise_state_writer *incise_state_new(
	const char *path, const struct incise_state_setup *setup,
	struct incise_error *err);

/**
 * Publish a change of state; it is in the file when this returns. Call this and the functions
 * below in the normal thread; they accept a writer of NULL.
 *
 * @param reason one line, truncated to 299 bytes; NULL or "" for no reason
 */
INCISE_API void incise_state_run(struct incise_state_writer *writer, enum incise_run run,
				 const char *reason);

/**
 * Publish the scene: before the first tick and after each reload, which this counts.
 *
 * @param path path of the scene; only the last 511 bytes are kept
 * @param plan plan with the stages, may be running; NULL: no stages
 */
INCISE_API void incise_state_scene(struct incise_state_writer *writer, const char *path,
				   const struct incise_plan *plan);

/** Count a failed reload. @param reason replaces the state's reason */
INCISE_API void incise_state_refused(struct incise_state_writer *writer,
				     const char *reason);

/** Publish the counts of the loop's thread: incise_realtime_count(). */
INCISE_API void incise_state_counts(struct incise_state_writer *writer,
				    const struct incise_realtime_counts *counts);

/** Copy the last state to the file and close it; the file stays. */
INCISE_API void incise_state_free(struct incise_state_writer *writer);

/**
 * Number of buckets of durations. Each duration below 32 ns has its own bucket; above, each
 * octave has 32, at most 3.2 % wide; the last bucket is open, from 17.2 s on.
 */
#define INCISE_STATE_BUCKETS 961
/** Number of durations per bucket. */
struct incise_state_histogram {
	uint64_t count[INCISE_STATE_BUCKETS];
};

/** Longest time of a bucket, ns; INFINITY for the open bucket. Real-time safe. */
INCISE_API double incise_state_edge(int bucket) INCISE_REALTIME;

/** The sum of all counts. */
INCISE_API uint64_t incise_state_total(const struct incise_state_histogram *histogram);

/**
 * A quantile, ns: the longest time of its bucket, so that it is at most 3.2 % too large and
 * never too small.
 *
 * @param share 0 … 1
 * @return 0 without counts; INFINITY in the open bucket
 */
INCISE_API double incise_state_quantile(const struct incise_state_histogram *histogram,
					double share);

/** Contents of a status file, without the ring. Strings are printable and terminated. */
struct incise_state_now {
	bool alive; /**< the writer is running; else this is its last state */
	bool torn;  /**< the writer died while writing: parts are older than others */

	int64_t pid;		   /**< process of the writer */
	int64_t start_ns;	   /**< CLOCK_MONOTONIC when the file was created */
	int64_t start_realtime_ns; /**< CLOCK_REALTIME then */
	double rate_hz;
	char rig[256];
	char policy[128];

	enum incise_run run;
	int64_t since_ns; /**< CLOCK_MONOTONIC of the last change; reloads are ignored */
	char reason[300];
	char scene[512];
	int n_stages;
	char stage[INCISE_PLAN_STAGES_MAX][24];
	int left_out;	       /**< stages that the scene does not need */
	uint64_t reloads;      /**< successful */
	uint64_t refused;      /**< failed reloads */
	uint64_t minor_faults; /**< pages mapped, by the loop's thread */
	uint64_t major_faults; /**< pages read from a disk */
	uint64_t voluntary;    /**< waits: one per tick */
	uint64_t involuntary;  /**< preemptions */

	uint64_t ticks;
	uint64_t skipped;		     /**< skipped ticks */
	uint64_t overruns;		     /**< gaps of one or more skipped ticks */
	uint64_t flagged[INCISE_TICK_FLAGS]; /**< ticks with that flag */
	uint64_t limited;		     /**< ticks CLAMPED or SLEWED or both */
	double force_N, force_max_N;	     /**< magnitude of the commanded force */
	int64_t lateness_ns, lateness_max_ns;
	int64_t cost_ns, cost_max_ns;
	uint64_t lateness_sum_ns, cost_sum_ns; /**< over all ticks */
	double absorbed_mJ;		       /**< work of the hand on the tissue */
	double returned_mJ;	 /**< work of the tissue on the hand, ≥ 0 */
	int64_t first_ns;	 /**< time of the first tick, by the loop's clock */
	struct incise_tick tick; /**< last tick */

	/** May differ from the rest by a tick. */
	struct incise_state_histogram lateness, cost;
};

/**
 * Open a status file. The contents are not trusted: a malformed file leads to an errno. The
 * file is read, not mapped: truncation leads to an errno, not to a signal. If the file is
 * malformed although its writer is running, it was just truncated, and this function tries
 * again for up to 1 s.
 *
 * @return state, to be closed with incise_state_close(); NULL with errno of open(2), EINVAL
 *         (not a status file), EPROTO (another version of the format), ENOMEM.
 */
INCISE_API struct incise_state *incise_state_open(const char *path,
						  struct incise_error *err);

/**
 * Copy the contents of a status file.
 *
 * @return 0; -EAGAIN (each copy was inconsistent, or the running writer is restoring a
 *         truncated file: try again), -EIO (truncated or malformed). About 6 system calls,
 *         never waits.
 */
INCISE_API int incise_state_read(struct incise_state *state,
				 struct incise_state_now *now);

#define INCISE_STATE_NEWEST UINT64_MAX /**< cursor for ticks from now on only */

/**
 * Read the ticks since the last call, oldest first. Each reader has its own cursor: the number
 * of the next tick, counted from 0.
 *
 * @param cursor 0: from the oldest in the ring; INCISE_STATE_NEWEST: from now on. Is advanced
 * @param n      capacity of @ticks
 * @param lost   increased by the number of ticks that were overwritten before they were read;
 *               or NULL
 * @return number of ticks; -EAGAIN, -EIO as above. Never waits.
 */
INCISE_API int incise_state_ticks(struct incise_state *state, uint64_t *cursor,
				  struct incise_tick *ticks, int n, uint64_t *lost);

/** Test whether the writer is running. @return 1 or 0; -EIO */
INCISE_API int incise_state_alive(struct incise_state *state);

/** NULL is accepted. The file remains. */
INCISE_API void incise_state_close(struct incise_state *state);

INCISE_END_DECLS
#endif

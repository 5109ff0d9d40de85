/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A whole capture: the recorder of incise/recorder.h, driven by the rig's clock from its start to
 * the verdict on what was recorded. Part of libincise-record.
 *
 *     waiting ── time, pulse, force, button ──► recording ── duration, stop, failure ──► end
 *           ╰──────────────── a poll and a step every 10 ms ────────────────╯
 */
#ifndef INCISE_CAPTURE_H
#define INCISE_CAPTURE_H

#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/wall.h>

INCISE_BEGIN_DECLS

/** State of a capture after a poll. */
struct incise_capture_state {
	/** for its stats, markers and incise_recorder_trigger() */
	struct incise_recorder *recorder;
	bool armed;	  /**< waits for its trigger */
	double seconds;	  /**< since the recording, or the waiting, started */
	double planned_s; /**< duration of the recording; 0: unknown */
	double left_s; /**< armed: until the start at a time; NAN: no such time is known */
};

/** Options of a capture; {0} and a calibration record until it is stopped. */
struct incise_capture_options {
	/** .planned_s and .armed are ignored: they follow from the other options. */
	struct incise_recorder_setup recorder;
	/** 0: until it is stopped, on the simulated rig at the end of its cuts */
	double duration_s;
	/**
	 * Device of the stepper module, /dev/incise-stepper0: a pulse of its SYNC line is an event
	 * and triggers. A named pipe of such events serves for tests. NULL: none
	 */
	const char *sync;
	bool at_time;	  /**< a time triggers: start_ns */
	bool start_tai;	  /**< it is TAI, else UTC */
	int64_t start_ns; /**< since 1970 */
	/** a value other than 0 ends the recording; or NULL */
	const volatile sig_atomic_t *stop;
	/** Called after each poll, or NULL. A negative errno ends the capture; it must set @err. */
	int (*step)(void *context, const struct incise_capture_state *state,
		    struct incise_error *err);
	/** Called with a line about something that can still be mended, or NULL. */
	void (*warn)(void *context, const char *text);
	void *context;
};

/** The result of a capture. */
struct incise_capture_result {
	double seconds;	  /**< recorded */
	int64_t start_ns; /**< of the first sample, about */
	struct incise_error
		early; /**< cause, if it ended by itself; code 0: it did not */
	struct incise_recorder_stats stats;
	/** NULL: none; to be freed with incise_wall_free() */
	struct incise_wall *wall;
};

/**
 * Read the time of a start, "2026-11-27T12:00:00Z" (UTC), or with TAI in place of Z, into options.
 *
 * @return 0; -EINVAL: *err says what is expected. Thread-safe.
 */
INCISE_API int incise_capture_start_at(struct incise_capture_options *options,
				       const char *text, struct incise_error *err);

/**
 * Record a rig until the duration is over, it is stopped, the disk is nearly full or no device is left.
 *
 * @param path   folder NAME.rec; must not exist
 * @param rig    as for incise_recorder_new(); not owned
 * @param result its wall time must be freed, also after a failure
 * @return 0: @path is a complete recording, maybe of samples that incise_capture_judge() rejects;
 *         -ECANCELED (it was never triggered), -EINVAL (the start is in the past, or the clock has no
 *         wall time), negative errno of result->early: nothing was recorded; errno of open(2) for @sync,
 *         -ENOTTY (it is no controller of the stepper module, or without a SYNC line), -ENODEV (it is
 *         gone); errno of incise_recorder_new(), _poll(), _mark_at(), _end() and _close(), after which the
 *         committed data remain readable in NAME.rec.part; the return value of options->step, after
 *         which @path is complete. Not for real-time threads.
 */
INCISE_API int incise_capture_run(const char *path, struct incise_rig *rig,
				  const struct incise_capture_options *options,
				  struct incise_capture_result *result,
				  struct incise_error *err);

/**
 * Judge a recording that incise_capture_run() made: warn of doubtful samples, and reject one that
 * is not complete.
 *
 * @param path    its name in messages
 * @param options those of the capture
 * @return 0; negative errno of result->early; -ENODEV (a device failed), -ENODATA (one sent no sample,
 *         samples were lost, or no pose was usable).
 */
INCISE_API int incise_capture_judge(const char *path,
				    const struct incise_capture_options *options,
				    const struct incise_capture_result *result,
				    struct incise_error *err);

INCISE_END_DECLS
#endif

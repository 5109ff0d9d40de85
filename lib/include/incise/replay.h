/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The haptic loop, run on a recording: the force that it would have requested, next to the
 * measured one. Part of libincise-record.
 *
 *     poses   ·       ·       ·       ·       at their arrival, or their acquisition
 *     tick    |   |   |   |   |   |   |   |   at the multiples of the scene's period
 *     force   ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯     its mean over a period around the tick
 *
 * Time is the recording's. Nothing depends on the computer's clock, so forces are the same, to
 * the bit, in each run and at any speed.
 */
#ifndef INCISE_REPLAY_H
#define INCISE_REPLAY_H

#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/loop.h>
#include <incise/plan.h>
#include <incise/recording.h>
#include <incise/scene.h>
#include <incise/tool.h>

INCISE_BEGIN_DECLS

/** The time at which the loop receives a pose. */
enum incise_replay_at {
	/** At its arrival, as late as it was: as in the live loop. */
	INCISE_REPLAY_ARRIVAL,
	/** At its best time of acquisition, as from a tracker without latency. */
	INCISE_REPLAY_ACQUISITION,
};

/** One tick and the recording at its time. */
struct incise_replay_tick {
	const struct incise_tick *tick; /**< lives as long as the call */
	double t_s;	 /**< since the recording's first force sample, as in exports */
	double done;	 /**< share of the recording, 0 … 1 */
	int cut;	 /**< by the recording's depth, as in exports; 0 outside */
	double depth_mm; /**< the recording's, positive in the tissue; NAN: not known */
	double predicted_N; /**< requested, along the normal of the touched surface, else of
				 the recording's */
	double measured_N; /**< mean over the period around the tick; NAN: no sample, or
				the recording ended before its zero was known */
	bool clipped;	   /**< the converter was at an end of its range in that period */
};

/** Options of a replay; {0} has the defaults. */
struct incise_replay_options {
	enum incise_replay_at at;
	enum incise_tool tool;
	bool real_time; /**< wait for each tick; else as fast as it goes */
	const struct incise_calibration
		*calibration;		   /**< of force, for the recording's */
	const volatile sig_atomic_t *stop; /**< not 0 ends it, with 0; or NULL */
	/** Called for each tick, or NULL; a negative errno ends the replay, and sets @err. */
	int (*ticked)(void *context, const struct incise_replay_tick *tick,
		      struct incise_error *err);
	void *context;
};

/** The result of a replay. Errors are predicted less measured, over ticks inside cuts. */
struct incise_replay_report {
	double seconds;			    /**< of the recording, first tick to last */
	struct incise_tracker_info tracker; /**< of the plan */
	uint64_t poses;			    /**< given to the loop */
	int cuts;
	uint64_t spells
		[INCISE_TICK_FLAGS]; /**< number of times that flag 1 << i started */
	uint64_t compared; /**< ticks in cuts with a force that was not clipped */
	double rms_N;	   /**< NAN without any */
	double max_N;	   /**< largest size */
	double max_t_s;	   /**< time of that */
	double range_N;	   /**< largest less least measured force of them */
	uint64_t late;	   /**< ticks a period late or more; 0 if not in real time */
	uint32_t crc;	   /**< CRC32C of all command_N, 3 little-endian doubles a tick */
};

/**
 * Run the loop of a scene on a recording. A scene without a surface gets the plane of the rig
 * that was recorded; poses are of the recorded tracker. Records with an error status are fed
 * too; as live, those that are no poses (incise_pose_usable()) are not used. Memory does not
 * grow with the recording's length.
 *
 * @param stats as of incise_loop_run(), lateness only in real time; unchanged if the loop does
 *        not start
 * @return 0; -EINVAL (impossible or missing rows), -ENODATA (no pose, or shorter than a tick),
 *         -EIO, -ENOMEM; errno of incise_plan_new_fed_on(); the return value of
 *         options->ticked.
 */
INCISE_API int incise_replay(struct incise_recording *recording,
			     const struct incise_scene *scene,
			     const struct incise_replay_options *options,
			     struct incise_loop_stats *stats,
			     struct incise_replay_report *report,
			     struct incise_error *err);

INCISE_END_DECLS
#endif

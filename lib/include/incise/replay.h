/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The haptic loop, run on a recording: what would have been felt, beside what was
 * measured. Part of libincise-record.
 *
 *     poses   ·       ·       ·       ·       at their arrival, or their acquisition
 *     tick    |   |   |   |   |   |   |   |   at the multiples of the scene's period
 *     force   ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯     its mean over a period around the tick
 *
 * Time is the recording's. Nothing depends on the clock of the computer, so forces are the
 * same, to the bit, from run to run and at any speed.
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

/** When a pose is given to the loop. */
enum incise_replay_at {
	/** When it had arrived, as late as it was: what the live loop would have done. */
	INCISE_REPLAY_ARRIVAL,
	/** At its best time of acquisition, as from a tracker without latency. */
	INCISE_REPLAY_ACQUISITION,
};

/** One tick and what belongs to it. */
struct incise_replay_tick {
	const struct incise_tick *tick; /**< lives as long as the call */
	double t_s;	 /**< since the recording's first force sample, as in exports */
	double done;	 /**< share of the recording, 0 … 1 */
	int cut;	 /**< by the recording's depth, as in exports; 0 outside */
	double depth_mm; /**< the recording's, positive in the tissue; NAN: not known */
	double predicted_N; /**< asked for, along the normal: of the surface that is
				 touched, else of the recording's */
	double measured_N;  /**< mean over the period around the tick; NAN: no sample, or
				the recording ended before its zero was known */
	bool clipped;	    /**< the converter was at an end of its range in it */
};

/** How to replay; {0} is a good start. */
struct incise_replay_options {
	enum incise_replay_at at;
	enum incise_tool tool;
	bool real_time; /**< wait for each tick; else as fast as it goes */
	const struct incise_calibration
		*calibration;		   /**< of force, for the recording's */
	const volatile sig_atomic_t *stop; /**< not 0 ends it, with 0; or NULL */
	/** Told of each tick; a negative errno ends it, and sets @err. Or NULL. */
	int (*ticked)(void *context, const struct incise_replay_tick *tick,
		      struct incise_error *err);
	void *context;
};

/** What a replay came to. Errors are predicted less measured, over ticks inside cuts. */
struct incise_replay_report {
	double seconds;			    /**< of the recording, first tick to last */
	struct incise_tracker_info tracker; /**< that the plan was made for */
	uint64_t poses;			    /**< given to the loop */
	int cuts;
	uint64_t spells[INCISE_TICK_FLAGS]; /**< how often flag 1 << i began */
	uint64_t compared; /**< ticks in cuts with a force that was not clipped */
	double rms_N;	   /**< NAN where none is */
	double max_N;	   /**< largest size */
	double max_t_s;	   /**< where that is */
	double range_N;	   /**< largest less least measured force of them */
	uint64_t
		late; /**< ticks that began a period late or more; 0 as fast as it goes */
	uint32_t crc; /**< CRC32C of all command_N, 3 little-endian doubles a tick */
};

/**
 * Run the loop of a scene on a recording. The plane of a scene without a surface is that of
 * the rig that it was recorded on; poses are of the tracker that it names. What the tracker
 * doubts is fed like the rest, as live. Memory does not grow with the recording's length.
 *
 * @param stats as of incise_loop_run(), lateness only in real time; caller's memory, as it was
 *        where the loop does not begin
 * @return 0; -EINVAL (rows that cannot be, rows missing), -ENODATA (no pose, or shorter than
 *         a tick), -EIO, -ENOMEM; errno of incise_plan_new_fed_on(); what options->ticked
 *         returned.
 */
INCISE_API int incise_replay(struct incise_recording *recording,
			     const struct incise_scene *scene,
			     const struct incise_replay_options *options,
			     struct incise_loop_stats *stats,
			     struct incise_replay_report *report,
			     struct incise_error *err);

INCISE_END_DECLS
#endif

/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The haptic loop on a recording: the force that it would have commanded, compared with the
 * measured one. Part of libincise-record.
 *
 *     poses   ·       ·       ·       ·       at their arrival, or their acquisition
 *     tick    |   |   |   |   |   |   |   |   at the multiples of the scene's period
 *     force   ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯ ╰─╯     its mean over a period around the tick
 *
 * Time is the recording's. Nothing depends on the computer's clock, so that forces are
 * bit-exact in each run and at any speed.
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
	/** At its arrival, with its latency, as in the live loop. */
	INCISE_REPLAY_ARRIVAL,
	/** At its best time of acquisition, as from a tracker without latency. */
	INCISE_REPLAY_ACQUISITION,
};

/** One tick and the recording at its time. */
struct incise_replay_tick {
	const struct incise_tick *tick; /**< valid during the call */
	double t_s;  /**< since the recording's first force sample, as in exports */
	double done; /**< share of the recording, 0 … 1 */
	/** number by the recording's depth, as in exports; 0 outside of cuts */
	int cut;
	double depth_mm; /**< from the recording, positive in the tissue; NAN: unknown */
	/** Commanded force along the normal of the touched surface, else of the recording's. */
	double predicted_N;
	/** Mean over the period around the tick; NAN: no sample, or the zero is unknown. */
	double measured_N;
	bool clipped; /**< the converter was at an end of its range in that period */
};

/** Options of a replay; {0} has the defaults. */
struct incise_replay_options {
	enum incise_replay_at at;
	enum incise_tool tool;
	bool real_time; /**< wait for each tick; else as fast as possible */
	const struct incise_calibration
		*calibration; /**< replaces the force's, or NULL */
	/** a value other than 0 ends it, with 0; or NULL */
	const volatile sig_atomic_t *stop;
	/**
	 * Called for each tick, or NULL; a negative errno ends the replay; it must set @err.
	 */
	int (*ticked)(void *context, const struct incise_replay_tick *tick,
		      struct incise_error *err);
	void *context;
};

/** The result of a replay. Errors are predicted minus measured, over ticks in cuts. */
struct incise_replay_report {
	double seconds;			    /**< duration from first to last tick */
	struct incise_tracker_info tracker; /**< tracker of the plan */
	uint64_t poses;			    /**< number of poses for the loop */
	int cuts;
	uint64_t spells
		[INCISE_TICK_FLAGS]; /**< number of times that flag 1 << i started */
	uint64_t compared;	     /**< ticks in cuts with an unclipped force */
	double rms_N;		     /**< NAN without compared ticks */
	double max_N;		     /**< largest absolute error */
	double max_t_s;		     /**< its time */
	double range_N; /**< largest minus smallest measured force of these */
	uint64_t late;	/**< ticks at least a period late; 0 if not in real time */
	/** CRC32C of all command_N, 3 little-endian doubles per tick */
	uint32_t crc;
};

/**
 * Run the loop of a scene on a recording. A scene without a surface uses the plane of the
 * recorded rig; poses come from the recorded tracker. Records with an error flag are passed
 * on; as in a live loop, unusable poses (incise_pose_usable()) have no effect. Memory does not
 * grow with the length of the recording.
 *
 * @param stats as for incise_loop_run(), with latency only in real time; unchanged if the loop
 *              does not start
 * @return 0; -EINVAL (invalid or missing rows), -ENODATA (no pose, or shorter than a tick),
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

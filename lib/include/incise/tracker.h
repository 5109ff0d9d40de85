/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Position and orientation of the scalpel, from a magnetic tracker.
 */
#ifndef INCISE_TRACKER_H
#define INCISE_TRACKER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/haptic.h>

INCISE_BEGIN_DECLS

/** One record of one station. */
struct incise_tracker_sample {
	int64_t t_ns; /**< arrival at the host; the acquisition is latency_ns earlier */
	uint64_t seq; /**< counts from 0; a gap is a lost record */
	double position_mm[3]; /**< tracked point, in the tracker's frame */
	/** unit, w first; from the scalpel's to the tracker's frame */
	double quaternion[4];
	char status;	 /**< flag, see incise_pose_usable(); ' ' or 0: no flag */
	uint8_t station; /**< number of the sensor, from 1; 1 on the simulated rig */
	bool button;	 /**< button of the stylus is pressed; false without one */
	bool restarted; /**< first record after an interruption: periods have a new phase */
	/** If t_ns is a timestamp of a sender: arrival at the host less t_ns, ns; else 0 */
	uint32_t after_ns;
};

/** Trigger of a measurement. */
enum incise_tracker_sync {
	INCISE_TRACKER_INTERNAL, /**< its own clock */
	INCISE_TRACKER_EXTERNAL, /**< pulses at its sync input */
	INCISE_TRACKER_VIDEO,	 /**< the video sync that it receives */
};

/** Settings of a real tracker; the group `tracker_setup` of rig.conf. */
struct incise_tracker_setup {
	int n_stations;
	uint8_t stations[4];  /**< 1 … 4, ascending; default {1} */
	double hemisphere[3]; /**< unit vector towards the sensor; default +x */
	enum incise_tracker_sync sync;
	uint8_t tube_station; /**< see struct incise_tracker_info; default 0 */
	double offset_mm[3];  /**< the tracked point in the sensor's frame; default 0 */
	/**
	 * A tracker that sends the same pose for longer, to the last digit, does not measure,
	 * because its noise changes each pose. Its poses then get the flag '=', which is
	 * unusable. 0: never; default 100.
	 */
	double repeat_ms;
};

/** Properties of a tracker. */
struct incise_tracker_info {
	char name[64];
	/** nominal rate of all stations together; see incise_tracker_station_hz() */
	double rate_hz;
	int64_t latency_ns; /**< nominal, from acquisition to arrival */
	int stations;	    /**< sensors that send records; seq counts all of them */
	/** Others trigger it: rate_hz is its highest or mean rate; records have no period. */
	bool external_sync;
	int64_t grain_ns; /**< grid of arrival times: 1000000 for USB; 0: no grid */
	/** Station on the scalpel: the first one; 0: every station but the tube's */
	uint8_t scalpel_station;
	uint8_t tube_station; /**< station at the end of the tube; 0: no such station */
	bool network;	      /**< poses come over a network, whose delay has no bound */
	char note[300];	      /**< a setting that its user should check; empty: none */
	/** Records come in blocks or chunks, so that the count of losses may lack some. */
	bool lost_unsure;
	/**
	 * The haptic device whose poses these are, and that takes the force; NULL: none. Valid as long as
	 * the tracker.
	 */
	const struct incise_haptic_info *haptic;
};

/** Counts of poses and of their flags. */
struct incise_pose_counts {
	uint64_t poses;	       /**< all poses, including the following */
	uint64_t unusable;     /**< see incise_pose_usable() */
	uint64_t flagged[128]; /**< by flag, usable or not; '?' counts all others */
};

/**
 * Return whether a pose with this flag is usable. The rule applies to all users of poses: an
 * unusable pose is kept and counted, but moves nothing and gives no depth.
 *
 * Usable are ' ' and 0 (no flag) and the flags of a FASTRAK or LIBERTY that do not concern the
 * measurement: m and w (memory), t and u (its correction for metal does not cover this place),
 * v (no video sync). rig.conf(5) lists all flags.
 */
INCISE_API bool incise_pose_usable(char status) INCISE_REALTIME;

/** Meaning of a flag in a few words, for people; never NULL. */
INCISE_API const char *incise_pose_flag(char status);

/** Count a pose. @return incise_pose_usable() */
INCISE_API bool incise_pose_count(struct incise_pose_counts *counts,
				  char status) INCISE_REALTIME;

/** Add counts to others. */
INCISE_API void incise_pose_counts_add(struct incise_pose_counts *counts,
				       const struct incise_pose_counts *more)
	INCISE_REALTIME;

/**
 * Print the flagged poses in one line: "3 of 361 poses were not used: 3 'x' (…)".
 *
 * @param text empty if no pose was flagged
 * @return length of the line, as snprintf(3). Not real-time safe.
 */
INCISE_API int incise_pose_counts_text(const struct incise_pose_counts *counts,
				       char *text, size_t size);

struct incise_tracker;

/**
 * Take records that have arrived, without waiting.
 *
 * @param samples array of @n records, oldest first
 * @return number of records, 0 … n; -EIO, -ENODEV (unplugged; a tracker that may reconnect,
 *         see rig.conf(5), returns 0 until its time is over). Real-time safe for the simulated
 *         rig and for Polhemus trackers; other backends document it.
 */
INCISE_API int incise_tracker_read(struct incise_tracker *tracker,
				   struct incise_tracker_sample *samples,
				   int n) INCISE_REALTIME;

/** Properties of the tracker. */
INCISE_API void incise_tracker_info(const struct incise_tracker *tracker,
				    struct incise_tracker_info *info);

/** Records of one station per second: all stations share rate_hz. Real-time safe. */
INCISE_API double incise_tracker_station_hz(const struct incise_tracker_info *info)
	INCISE_REALTIME;

/** Records lost so far, in the device or in full buffers. */
INCISE_API uint64_t incise_tracker_lost(const struct incise_tracker *tracker);

/**
 * Print the cause of a read error in one line that says what to do.
 *
 * @param text empty without an error, or without a known cause
 * @return length of the line, as snprintf(3). Not real-time safe.
 */
INCISE_API int incise_tracker_cause(struct incise_tracker *tracker, char *text,
				    size_t size);

INCISE_END_DECLS
#endif

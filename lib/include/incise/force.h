/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The force channel: raw codes of an A/D converter behind the bridge amplifier, which
 * incise/calibration.h converts to newtons; or steps of a device that measures newtons itself.
 */
#ifndef INCISE_FORCE_H
#define INCISE_FORCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** One conversion. */
struct incise_force_sample {
	int64_t t_ns; /**< time of acquisition */
	uint64_t seq; /**< counts from 0; a gap is a lost sample */
	int32_t code; /**< raw; 0 … 2^bits - 1 */
};

/** Properties of a force channel. */
struct incise_force_info {
	char name[64];
	double rate_hz;	     /**< nominal */
	int bits;	     /**< resolution */
	double full_scale_V; /**< 2^bits codes span this voltage */
	double offset_V;     /**< voltage of code 0; 0 for a unipolar range */
	uint64_t clipped;    /**< samples at either end of the range so far */
	uint64_t overflows;  /**< overflows of the device or the kernel so far */
	/** It measures newtons itself: full_scale_V and offset_V are in N, not in V. */
	bool newtons;
	/** Samples come in blocks or chunks, so that the count of losses may lack some. */
	bool lost_unsure;
	int64_t t_sd_ns; /**< standard deviation of its timestamps; 0: not known */
	char note[300];	 /**< a setting that its user should check; empty: none */
};

/** The voltage that an input is compared with. */
enum incise_force_reference {
	INCISE_FORCE_ANY, /**< the first of these that the card has */
	INCISE_FORCE_GROUND,
	INCISE_FORCE_COMMON,
	INCISE_FORCE_DIFFERENTIAL,
};

/** Settings of a real force channel; the group `force_setup` of rig.conf. */
struct incise_force_setup {
	double rate_hz; /**< 1 … 100000; default 10000 */
	int channel;	/**< 0 …; default 0 */
	/** IIO: its name, such as "voltage0-voltage1"; empty: it has the number @channel. */
	char channel_name[64];
	enum incise_force_reference reference; /**< comedi; default INCISE_FORCE_ANY */
	/** Range to select, and the scale of an IIO device without one; 0: the device's own. */
	double full_scale_V;
	/** IIO: name of the trigger; empty: an hrtimer if the kernel has it, else the driver's. */
	char trigger[64];
};

struct incise_force;

/**
 * Take samples that have arrived, without waiting.
 *
 * @param samples array of @n samples, oldest first
 * @return number of samples, 0 … n; -EIO, -ENODEV (unplugged).
 */
INCISE_API int incise_force_read(struct incise_force *force,
				 struct incise_force_sample *samples, int n);

/** Properties and current counts of the channel. */
INCISE_API void incise_force_info(const struct incise_force *force,
				  struct incise_force_info *info);

/**
 * Adapt a calibration to a channel. A channel that measures newtons has 1000 mV/N; unless the
 * calibration has these, its zero belongs to another device, and becomes NAN: it is measured.
 * A calibration stays as it is for a channel in volts.
 */
INCISE_API void incise_force_calibration(const struct incise_force_info *info,
					 struct incise_calibration *calibration);

/** Samples lost so far, in the device or in full buffers. */
INCISE_API uint64_t incise_force_lost(const struct incise_force *force);

/**
 * Print the cause of a read error in one line that says what to do.
 *
 * @param text empty without an error, or without a known cause
 * @return length of the line, as snprintf(3). Not real-time safe.
 */
INCISE_API int incise_force_cause(struct incise_force *force, char *text, size_t size);

INCISE_END_DECLS
#endif

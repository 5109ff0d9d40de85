/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The force channel: raw codes of an A/D converter behind the bridge amplifier.
 * Conversion to newtons is the calibration's, see incise/calibration.h.
 */
#ifndef INCISE_FORCE_H
#define INCISE_FORCE_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** One conversion. */
struct incise_force_sample {
	int64_t t_ns; /**< of acquisition */
	uint64_t seq; /**< counts from 0; a gap is a lost sample */
	int32_t code; /**< raw; 0 … 2^bits - 1 */
};

/** What a force channel says of itself. */
struct incise_force_info {
	char name[64];
	double rate_hz;	     /**< nominal */
	int bits;	     /**< resolution */
	double full_scale_V; /**< code 2^bits stands for this voltage */
};

struct incise_force;

/**
 * Take samples that have arrived, without waiting.
 *
 * @param samples room for @n samples, oldest first
 * @return how many were taken, 0 … n; -EIO, -ENODEV (unplugged).
 */
INCISE_API int incise_force_read(struct incise_force *force,
				 struct incise_force_sample *samples, int n);

INCISE_API void incise_force_info(const struct incise_force *force,
				  struct incise_force_info *info);

/** Samples lost so far, in the device or for want of room. */
INCISE_API uint64_t incise_force_lost(const struct incise_force *force);

INCISE_END_DECLS
#endif

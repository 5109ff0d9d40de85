/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What is known of one stream of a recording: its losses and its times. While it is
 * recorded, incise/recorder.h tells it; afterwards incise/recording.h does.
 *
 *     acquisition ──── delay ────► earliest ──── jitter ────► arrival   (CLOCK_MONOTONIC)
 *                                  arrival       ≥ 0
 *
 * A stream that is stamped carries its time itself, and its jitter is that of the stamps.
 * One that is not gets its times from the line of the device's own clock below all arrivals.
 */
#ifndef INCISE_STREAM_H
#define INCISE_STREAM_H

#include <stdbool.h>
#include <stdint.h>

/** Streams of a recording, at most. */
#define INCISE_STREAMS_MAX 3

/** What is not known is NAN. */
struct incise_stream {
	char name[16]; /**< force, tracker, camera */
	char device[64];
	bool stamped; /**< by the kernel or the converter, when it was acquired */
	double nominal_hz;
	double delay_ms, delay_sd_ms; /**< of calibration, or as the device says */
	uint64_t rows, lost;
	uint64_t late;			/**< more than a period behind the line */
	double rate_hz;			/**< measured by this computer's clock */
	double drift_ppm, drift_sd_ppm; /**< of the device's clock; fast is positive */
	double jitter_ms;		/**< standard deviation of arrivals or stamps */
	double jitter_max_ms;		/**< farthest above the line */
	double offset_ms; /**< in all: the delay, and what the line is too high */
	/** Standard uncertainty of times against this clock; without that of the delay, as
	 * long as delay_sd_ms is NAN. */
	double offset_sd_ms;
	char ended[200]; /**< why it died before the recording's end; empty: it did not */
};

#endif

/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading a recording, and exporting it as a dataset (paper 1, §4.1). Part of
 * libincise-record.
 */
#ifndef INCISE_RECORDING_H
#define INCISE_RECORDING_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/tracker.h>

INCISE_BEGIN_DECLS

/** Streams of a recording, at most. */
#define INCISE_STREAMS_MAX 3

/**
 * One stream of a recording: its losses and its times. NAN: not known.
 *
 *     acquisition ──── delay ────► earliest ──── jitter ────► arrival   (CLOCK_MONOTONIC)
 *                                  arrival       ≥ 0
 *
 * A timestamped stream has its times from the device or the kernel, and its jitter is that of
 * the timestamps. Another one gets its times from the line of the device's own clock below all
 * arrivals.
 */
struct incise_stream {
	char name[16]; /**< force, tracker, camera */
	char device[64];
	bool timestamped; /**< by the kernel or the converter, at the acquisition */
	double nominal_hz;
	double delay_ms, delay_sd_ms; /**< of the calibration or the device */
	uint64_t rows, lost;
	uint64_t late;			/**< more than a period behind the line */
	double rate_hz;			/**< measured by this computer's clock */
	double drift_ppm, drift_sd_ppm; /**< of the device's clock; fast is positive */
	double jitter_ms;     /**< standard deviation of arrivals or timestamps */
	double jitter_max_ms; /**< farthest above the line */
	double offset_ms; /**< in all: the delay, and the expected error of the line */
	/** Standard uncertainty of times against this clock; without that of the delay if
	 * delay_sd_ms is NAN. */
	double offset_sd_ms;
	char ended[200]; /**< cause of an end before the recording's; empty: none */
};

struct incise_recording;

/** A cut starts above this depth, mm. */
#define INCISE_CUT_START_MM 0.3
/** And ends below this one: apart by ten times the tracker's noise, which ends no cut so. */
#define INCISE_CUT_END_MM 0.1

/** The contents of a recording. */
struct incise_recording_info {
	bool complete; /**< closed by its recorder; false: readable up to the last commit */
	int64_t start_ns, end_ns; /**< first and last force sample, CLOCK_MONOTONIC */
	char started[32];	  /**< wall clock at the start, ISO 8601 UTC */
	char rig[256];		  /**< specification of the rig */
	uint64_t force, tracker, depth; /**< rows */
	uint64_t force_lost, tracker_lost, force_clipped;
	int bits;
	double full_scale_V, offset_V; /**< range of 2^bits codes; voltage of code 0 */
	double force_mV_N, zero_mV, depth_mm_px; /**< calibration when it was made */
	double surface_normal[3], surface_point_mm[3];
	double tip_mm[3]; /**< calibrated; poses are without it, depth is with it */
	int cuts;	  /**< times with the blade in the tissue */
	double depth_max_mm, force_max_N;
	struct incise_stream streams[INCISE_STREAMS_MAX]; /**< of form 2 */
	int n_streams;
};

/**
 * Open a recording for reading. If NAME.rec is absent and a crash or a full disk has left
 * NAME.rec.part, open that.
 *
 * @return recording, to be closed with incise_recording_close(); NULL with errno ENOENT,
 *         EINVAL (no recording, a damaged one, or of a newer version), EIO, ENOMEM.
 */
INCISE_API struct incise_recording *incise_recording_open(const char *path,
							  struct incise_error *err);
/** NULL is accepted. */
INCISE_API void incise_recording_close(struct incise_recording *recording);

/** @return 0, -EINVAL (an impossible row), -EIO. */
INCISE_API int incise_recording_info(struct incise_recording *recording,
				     struct incise_recording_info *info,
				     struct incise_error *err);

/** One value of a stream. */
struct incise_recording_value {
	int64_t t_ns; /**< best time of its acquisition, CLOCK_MONOTONIC */
	double value;
};

/**
 * All of a stream in memory: "force", N (NAN where it is clipped; from the converter's 0 V
 * if its zero is not known); "depth", mm by the tracker; "camera", mm by vision, only of the
 * frames in which it found the scalpel.
 *
 * @param values to be freed with free(3)
 * @return how many, 0 of an absent stream; -EINVAL (no such name, an impossible row), -EIO,
 *         -ENOMEM.
 */
INCISE_API int incise_recording_values(struct incise_recording *recording,
				       const char *name,
				       struct incise_recording_value **values,
				       struct incise_error *err);

/**
 * All poses of the tracker as received, with their best times.
 *
 * @param poses to be freed with free(3)
 * @return how many; -EINVAL (an impossible row), -EIO, -ENOMEM.
 */
INCISE_API int incise_recording_poses(struct incise_recording *recording,
				      struct incise_tracker_sample **poses,
				      struct incise_error *err);

/** Exposed length in a frame, with the tracker's depth at its time. */
struct incise_recording_length {
	int64_t t_ns; /**< of the frame, CLOCK_MONOTONIC */
	double length_px;
	double quality;	 /**< as incise/vision.h */
	double depth_mm; /**< below 0 in the air */
	double velocity_mm_s;
};

/**
 * All frames in which vision found the scalpel while recording, in order, with the depth
 * interpolated between the tracker's records around each; without those that have no record
 * within 50 ms on both sides.
 *
 * @param lengths to be freed with free(3); NULL for none
 * @return how many; -EINVAL (an impossible row; a recording of form 1 has no frames), -EIO,
 *         -ENOMEM
 */
INCISE_API int incise_recording_lengths(struct incise_recording *recording,
					struct incise_recording_length **lengths,
					struct incise_error *err);

/** Options of an export. */
struct incise_export_options {
	double rate_hz; /**< rows per second of raw export, each the mean of its force
			     samples; 0: every force sample */
	int depth_bins; /**< 0: raw; else averaged over depth_bins × velocity_bins */
	int velocity_bins;
	double depth_max_mm; /**< upper end of the bins; 0: the largest where the blade
				advances */
	double velocity_max_mm_s;
	bool by_cut;   /**< average each cut by itself, giving a cut column */
	int min_count; /**< bins with fewer force samples are left out; default 50 */

	bool resample; /**< all of the recording, with the pose, at each force sample or,
			    with a rate, on a grid; see incise-export(1) */
	/** In place of the recordings': force, the camera's depth, and the delays it has. */
	const struct incise_calibration *calibration;
	bool provenance; /**< CSV starts with lines "# key: value"; HDF5 and MCAP always have
			      it */

	/** Called now and then with the share that is done, 0 to 1, or NULL; a value other
	 * than 0 stops the export. */
	int (*progress)(void *context, double share);
	void *context;
};

/** Raw: every force sample of each cut, with the recordings' own calibration. */
INCISE_API void incise_export_options_init(struct incise_export_options *options);

/** Result of an export. */
struct incise_export_report {
	uint64_t rows;
	int cuts;
	uint64_t
		clipped; /**< force samples at either end of the converter, not in averages */
	double depth_max_mm, velocity_max_mm_s;
};

/**
 * Export to a file whose name has the format: .h5 and .hdf5 are HDF5, .mcap is MCAP, any
 * other is CSV. The file appears under its name when it is complete.
 *
 * CSV has the cuts of some recordings. Raw: cut,t_s,depth_mm,velocity_mm_s,force_N,clipped,
 * advancing. Averaged: [cut,]depth_mm,velocity_mm_s,force_N,sd_N,count,cuts,advancing, each
 * bin once for where the blade advances and once for where not. Depth and velocity are
 * interpolated at the times of the force samples.
 *
 * HDF5 has a dataset of one dimension per column, named like it, with the attributes
 * units and description; the column cut holds numbers from 1 into the dataset cut_names.
 * The root's attributes are the provenance.
 *
 * MCAP is all of one recording for viewers, not only its cuts: /force, /tracker, /depth
 * and /events in JSON; rows of the report are messages then, and cuts 0.
 *
 * @param recordings n of them
 * @param report     or NULL
 * @return 0; -ENODATA (no cut in any recording), -EINVAL, -EIO, -ENOSPC, -ENOMEM; -ENOENT
 *         without the module export_hdf5.so; -EINTR if progress stopped it; errno of
 *         incise_outfile_open().
 */
INCISE_API int incise_export(struct incise_recording *const *recordings, int n,
			     const struct incise_export_options *options,
			     const char *path, struct incise_export_report *report,
			     struct incise_error *err);

INCISE_END_DECLS
#endif
